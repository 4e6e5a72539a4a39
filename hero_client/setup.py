"""Python package of hero_client, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

ROOMS = ("values", "controllers", "ros", "robots", "apps")

setup(
    **generate_distutils_setup(
        packages=["hero_client", *("hero_client." + room for room in ROOMS)],
        package_dir={"": "src"},
        package_data={"hero_client": ["py.typed"]},
    )
)
