"""Building blocks of programs for HeRo robots: `from hero_client import Robot, Swarm`.

The two are fetched when asked for, so that the pure modules of this package work where there is no ROS.
"""

from typing import Any

__all__ = ["Robot", "Swarm"]


def __getattr__(name: str) -> Any:
    """Return Robot or Swarm (PEP 562)."""
    if name not in __all__:
        raise AttributeError("hero_client has no attribute %r" % name)
    from . import robot, swarm

    return getattr(robot if name == "Robot" else swarm, name)
