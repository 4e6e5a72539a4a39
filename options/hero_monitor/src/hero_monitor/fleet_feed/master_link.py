"""Asks the ROS master periodically whether it answers, and registers with one that was started again.

Pages show if it is lost, and work without it.
"""

import time
from concurrent.futures import Future
from typing import Optional

import rosgraph
import rospy

from hero_node.ros import MasterWatch

from ..background import Background
from .losses import MASTER_PERIOD_S, MASTER_SILENT_S


class MasterLink:
    """The ROS master, as far as it answers."""

    def __init__(self, background: Background) -> None:
        self._background = background
        self._watch = MasterWatch()
        self._asked_s = -MASTER_PERIOD_S
        self._look: Optional[Future[None]] = None

    def check(self, period_s: float = MASTER_PERIOD_S) -> str:
        """Ask if it is time to; return why the master is lost, empty if it answers. Returns at once."""
        now_s = time.monotonic()
        is_pending = self._look is not None and not self._look.done()
        if not is_pending and now_s - self._asked_s >= period_s:
            self._asked_s, self._look = now_s, self._background.submit(self._ask)
        is_late = is_pending and now_s - self._asked_s > MASTER_SILENT_S
        return f"{rosgraph.get_master_uri()} does not answer" if self._watch.is_lost or is_late else ""

    def _ask(self) -> None:
        news = self._watch.look()  # its errors stay in the future: is_lost tells
        if news:
            rospy.logwarn(news)
