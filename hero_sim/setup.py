"""Python package of hero_sim, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=["hero_sim"] + ["hero_sim." + room for room in ("link", "robot", "stepped", "world", "world.pushing")],
        package_dir={"": "src"},
        package_data={"hero_sim.world": ["arenas/*.yaml"]},
    )
)
