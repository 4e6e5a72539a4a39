"""Python package of hero_sim, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

ROOMS = ("link", "robot", "stepped", "stepped.rules", "world", "world.pushing")

setup(
    **generate_distutils_setup(
        packages=["hero_sim", *("hero_sim." + room for room in ROOMS)],
        package_dir={"": "src"},
        package_data={"hero_sim.world": ["arenas/*.yaml"]},
    )
)
