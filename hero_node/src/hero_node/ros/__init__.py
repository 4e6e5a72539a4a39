"""ROS nodes that start, run and end without endless waits."""

from threading import Thread

# The rospy of Debian 11 calls it when a script ends; its Python 3.9 no longer has it.
if not hasattr(Thread, "isAlive"):
    setattr(Thread, "isAlive", Thread.is_alive)  # noqa: B010 - mypy knows no such method
