"""Python package of hero_swarm, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

ROOMS = ("behaviors", "experiments", "experiments.reporting", "fitting", "learning", "metrics", "ros", "sensors")

setup(
    **generate_distutils_setup(
        packages=["hero_swarm", *("hero_swarm." + room for room in ROOMS)], package_dir={"": "src"}
    )
)
