"""Python package of hero_calibration, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

ROOMS = ("models", "robots", "procedures")

setup(
    **generate_distutils_setup(
        packages=["hero_calibration", *("hero_calibration." + room for room in ROOMS)], package_dir={"": "src"}
    )
)
