"""Asks the ROS master again and again whether it is there, and registers at one that was started again.

Pages are told, and go on without it. That the master knows this node does not say that it knows all its topics: one
that was registered meanwhile, or a registration that a timeout cut off, is enough for that. So registering is repeated
until it has succeeded as a whole.
"""

import time
from typing import Optional

import rosgraph
import rospy

from hero_node.errors import NodeError
from hero_node.ros.master import ask_master
from hero_node.ros.registration import is_registered, register_again

from ..background import Background
from .losses import MASTER_PERIOD_S, MASTER_SILENT_S


class MasterLink:
    """The ROS master, as far as it answers."""

    def __init__(self, background: Background) -> None:
        self._background = background
        self._asked_s = -MASTER_PERIOD_S
        self._is_pending = False
        self._has_failed = False
        self._master_pid: Optional[int] = None  # of the master that has all registrations

    def check(self) -> str:
        """Ask if it is time to; return why the master is lost, empty if it answers. Returns at once."""
        now_s = time.monotonic()
        if not self._is_pending and now_s - self._asked_s >= MASTER_PERIOD_S:
            self._asked_s, self._is_pending = now_s, True
            self._background.submit(self._ask)
        is_late = self._is_pending and now_s - self._asked_s > MASTER_SILENT_S
        return "%s does not answer" % rosgraph.get_master_uri() if self._has_failed or is_late else ""

    def _ask(self) -> None:
        try:
            pid = ask_master("getPid")
            is_another = self._master_pid not in (None, pid)
            if is_another or self._has_failed or not is_registered():
                self._has_failed = True
                register_again()
                rospy.logwarn("the ROS master is back: the monitor is registered again")
            self._master_pid, self._has_failed = pid, False
        except NodeError:
            self._has_failed = True
        finally:
            self._is_pending = False
