"""Python package of hero_swarm, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import find_packages, setup

data = {"hero_swarm": ["published/*"]}
setup(**generate_distutils_setup(packages=find_packages("src"), package_dir={"": "src"}, package_data=data))
