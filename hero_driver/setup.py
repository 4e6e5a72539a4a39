"""Python package of hero_driver, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

ROOMS = ("rosserial", "transport", "fleet", "corrections", "commands", "ros", "stops", "reports")

setup(
    **generate_distutils_setup(
        packages=["hero_driver", *("hero_driver." + room for room in ROOMS)], package_dir={"": "src"}
    )
)
