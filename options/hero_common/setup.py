"""Python package of hero_common, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(packages=["hero_common", "hero_common.msg", "hero_common.srv"], package_dir={"": "src"})
)
