"""Python package of hero_monitor, for catkin_python_setup(); not to be run by hand."""

from catkin_pkg.python_setup import generate_distutils_setup
from setuptools import setup

setup(
    **generate_distutils_setup(
        packages=[
            "hero_monitor",
            "hero_monitor.control",
            "hero_monitor.fleet_feed",
            "hero_monitor.foxglove",
            "hero_monitor.serving",
        ],
        package_dir={"": "src"},
        package_data={"hero_monitor": ["web/*", "web/*/*"]},
    )
)
