"""Python package of hero_localization, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

ROOMS = ("prints", "camera", "tracking", "filter", "mapping", "calibration", "nodes", "simulated_camera")

setup(
    **generate_distutils_setup(
        packages=["hero_localization", *("hero_localization." + room for room in ROOMS)], package_dir={"": "src"}
    )
)
