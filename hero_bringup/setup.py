"""Python package of hero_bringup, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=[
            "hero_bringup",
            "hero_bringup.calibration",
            "hero_bringup.checkup",
            "hero_bringup.monitor",
            "hero_bringup.recording",
        ],
        package_dir={"": "src"},
        package_data={"hero_bringup.monitor": ["web/*"]},
    )
)
