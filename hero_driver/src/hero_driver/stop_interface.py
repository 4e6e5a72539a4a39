"""The emergency stop in ROS: the service ~stop, the topic ~stop_request, and the stop kept over restarts.

Programs connect to ~stop_request at their start, so that it works while the ROS master is dead, hung or slow, and ask
until ~robots says that the robots are stopped. Whether they are is kept on the parameter server (~stopped) for a driver
that is started again under the same name.
"""

from typing import Any, Callable, List

import rospy
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, SetBoolResponse

from hero_msgs.msg import Robot

from .robot_status import RobotStatus
from .ros.log_relay import LogRelay
from .ros.worker import Worker
from .transport import EventLoop, NoAnswerError

PARAMETER = "~stopped"

ANSWER_WAIT_S = 0.5
"""The thread of the sockets answers within milliseconds; a service call must not hang where it does not."""


class StopInterface:
    """The stop of all robots, as ROS sees it."""

    def __init__(
        self,
        loop: EventLoop,
        set_stopped: Callable[[bool], None],
        is_stopped: Callable[[], bool],
        list_robots: Callable[[], List[RobotStatus]],
        log: LogRelay,
    ) -> None:
        """The three functions are called on the thread of the sockets."""
        self._loop = loop
        self._set_stopped = set_stopped
        self._is_stopped = is_stopped
        self._list_robots = list_robots
        self._log = log
        self._stopped = False  # as programs asked; at its end the driver stops robots without being asked
        self._publisher: rospy.Publisher
        self._service: rospy.Service
        self._keeper = Worker("stop parameter", 100, self._report_lost_parameter)

    def open(self, stopped: bool) -> None:
        """Serve; begin as stopped says. The loop does not run yet."""
        self._stopped = stopped
        self._set_stopped(stopped)
        if stopped:
            self._log.log("warn", "all robots are stopped from the start, until ~stop releases them")
        self._publisher = rospy.Publisher("~stopped", Bool, queue_size=1, latch=True)
        self._publisher.publish(Bool(stopped))
        rospy.Subscriber("~stop_request", Bool, self._take_request, queue_size=10, tcp_nodelay=True)
        self._service = rospy.Service("~stop", SetBool, self._serve)

    def keep(self) -> None:
        """Write down whether robots are stopped, after each change and for a ROS master that was started again."""
        self._keeper.submit(lambda: rospy.set_param(PARAMETER, self._stopped))

    def close(self) -> None:
        """Keep nothing any more; safe to call twice."""
        self._keeper.close()

    def _serve(self, request: Any) -> SetBoolResponse:
        stopped = bool(request.data)

        def set_and_answer(answer: Callable[[List[RobotStatus]], None]) -> None:
            self._set(stopped)
            answer(self._list_robots())

        try:
            robots = self._loop.ask(set_and_answer, ANSWER_WAIT_S)
        except NoAnswerError:
            return SetBoolResponse(False, "NOT STOPPED: the driver hangs" if stopped else "the driver hangs")
        return SetBoolResponse(True, describe_stop(robots) if stopped else "robots may move")

    def _take_request(self, message: Bool) -> None:
        stopped = bool(message.data)
        self._loop.call_soon(lambda: self._set(stopped))

    def _set(self, stopped: bool) -> None:
        """Runs on the thread of the sockets."""
        changed = stopped is not self._is_stopped()
        if not changed and not stopped:
            return
        self._stopped = stopped
        self._set_stopped(stopped)
        if changed:
            # Published and written elsewhere: both may block.
            self._keeper.submit(lambda: self._publisher.publish(Bool(stopped)))
            self.keep()
            self._log.log("warn", "stopping all robots" if stopped else "robots may move")

    def _report_lost_parameter(self, error: BaseException) -> None:
        self._log.log(
            "warn",
            "whether robots are stopped cannot be kept on the parameter server (%s): a driver that is started again"
            " begins without it" % error,
        )


def describe_stop(robots: List[RobotStatus]) -> str:
    """Return how far the stop of all robots has come, for people."""
    groups = (
        ("still moving", Robot.MOVING),
        ("being stopped", Robot.STOPPING),
        ("not confirmed, they send no readings of their wheels", Robot.UNCONFIRMED),
    )
    connected = [robot for robot in robots if robot.message.state != Robot.AWAY]
    parts = ["%d at rest" % sum(robot.message.stop_state == Robot.AT_REST for robot in connected)]
    for text, state in groups:
        names = [robot.name for robot in connected if robot.message.stop_state == state]
        if names:
            parts.append("%d %s: %s" % (len(names), text, ", ".join(names)))
    away = [robot.name for robot in robots if robot.message.state == Robot.AWAY]
    if away:
        parts.append("%d away, stopped when they return: %s" % (len(away), ", ".join(away)))
    return "; ".join(parts)
