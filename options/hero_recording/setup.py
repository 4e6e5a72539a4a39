"""Python package of hero_recording, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

packages = ["hero_recording", "hero_recording.bags", "hero_recording.formats", "hero_recording.plots"]
setup(**generate_distutils_setup(packages=packages, package_dir={"": "src"}))
