"""Python package of hero_client, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(**generate_distutils_setup(packages=["hero_client", "hero_client.controllers"], package_dir={"": "src"}))
