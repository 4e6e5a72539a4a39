"""The simulator as a ROS node: the same command line, and on top ground truth, markers, services and /clock.

ROS begins here and in ground_truth. The robots themselves talk to the driver over TCP and never over ROS.
"""

import os
import queue
import signal
import sys
import threading
import uuid
from contextlib import suppress
from typing import Tuple

import rospy

from hero_node import call
from hero_node.ros import MasterWatch, end_ros_node, find_running_node, init_ros_node, read_master_uri

from . import main as command_line
from .errors import OptionError
from .faults import FaultInjector, parse_fault
from .ground_truth import GroundTruth
from .simulator import Simulator
from .srv import InjectFault, InjectFaultRequest, InjectFaultResponse

NODE_NAME = "hero_sim"

SERVICE_LIMIT_S = 2.0
"""A service call that the simulator's thread does not serve by then is answered with a failure."""

MASTER_WAIT_S = 0.7
"""An unreachable master must not delay the end for longer."""

DRIVER_WAIT_S = 1.0
"""Time between two looks whether this node is to end."""

LINGER_S = 2.5
"""roslaunch ends all of its nodes at once; the driver takes up to 2 s to stop its robots."""


class FaultService:
    """The service ~fault: hands each fault from rospy's threads to the simulator's thread, and answers."""

    def __init__(self, simulator: Simulator, injector: FaultInjector) -> None:
        """Offer the service; the simulator executes what was asked between its steps."""
        self._injector = injector
        self._requests: queue.Queue[Tuple[str, queue.Queue]] = queue.Queue(maxsize=100)
        simulator.before_advance.append(self._run)
        rospy.Service("~fault", InjectFault, self._serve)

    def _run(self, now_ms: int) -> None:
        """Execute the requests since the last step (simulator's thread)."""
        del now_ms
        while not self._requests.empty():
            text, answer = self._requests.get()
            try:
                answer.put(InjectFaultResponse(True, self._injector.add(parse_fault(text))))
            except OptionError as error:
                answer.put(InjectFaultResponse(False, str(error)))

    def _serve(self, request: InjectFaultRequest) -> InjectFaultResponse:
        answer: queue.Queue[InjectFaultResponse] = queue.Queue()
        try:
            self._requests.put_nowait((request.fault, answer))
            return answer.get(timeout=SERVICE_LIMIT_S)
        except (queue.Empty, queue.Full):
            return InjectFaultResponse(False, f"the simulator did not answer within {SERVICE_LIMIT_S:g} s")


def wait_for_driver(name: str) -> bool:
    """Wait for the first report of the driver with this node name; return whether it came before the end.

    Its port may be that of a driver of another ROS master, whose swarm these robots must not join.
    """
    rospy.loginfo("waiting for the driver %s", name)
    while not rospy.is_shutdown():
        with suppress(rospy.ROSException):
            rospy.wait_for_message(name + "/robots", rospy.AnyMsg, DRIVER_WAIT_S)
            return True
    return False


def main() -> None:
    """Run the simulator until ROS or a signal ends it."""
    status = call(_run)
    end_ros_node("hero_sim ends", MASTER_WAIT_S)
    os._exit(status)


def _run() -> None:
    parser = command_line.build_parser()
    parser.add_argument("--clock", action="store_true", help="publish /clock: nodes with use_sim_time follow")
    parser.add_argument("--no-tf", action="store_true", help="leave transforms to odom frames to localization")
    parser.add_argument("--driver", metavar="NODE", help="connect once this driver, of the same ROS master, reports")
    options = command_line.parse_options(parser, rospy.myargv(sys.argv)[1:])
    read_master_uri()  # one that does not run yet is waited for
    # Until the master answers, init_node() waits for as long as it takes: let a signal end that.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    running = find_running_node(NODE_NAME)
    if running:
        raise OptionError(f"simulated robots already run as {running}: end them, or give these another name:=")
    init_ros_node(NODE_NAME)
    if options.driver and not wait_for_driver(options.driver):
        return
    with command_line.simulate(options, rospy.loginfo) as (simulator, injector):
        rospy.on_shutdown(lambda: setattr(simulator, "stopping", True))
        world = f" | World: {uuid.uuid4().hex[:8]}"
        for robot in simulator.swarm.robots:
            robot.world = world
        GroundTruth(simulator, options.clock, not options.no_tf)
        FaultService(simulator, injector)
        has_ended = threading.Event()
        rospy.on_shutdown(has_ended.set)
        MasterWatch().start(has_ended, rospy.logwarn)  # the driver reports a lost master
        simulator.run(options.seconds)
        if simulator.stopping and not rospy.is_shutdown():
            simulator.linger(LINGER_S)
