"""The driver of HeRo robots: connects any number of them to ROS, and stops them at its end.

rosrun hero_driver hero_driver _port:=11412
"""

import errno
import functools
import io
import os
import queue
import signal
import sys
import threading
import time
from typing import Any, Callable, List, Optional

import rosgraph
import rospy
from std_srvs.srv import Trigger, TriggerResponse

from hero_msgs.msg import RobotArray
from hero_node import ProgramError, print_error, ros

from .config import DriverConfig, read_config
from .gateway import STOP_LIMIT_S, Gateway
from .reports.reporter import FleetStatus, Reporter
from .reports.robot_status import find_stamp
from .ros import rospy_internals
from .ros.log_relay import LogRelay, report_dropped_log_lines
from .ros.thread_watch import ThreadWatch
from .stops.interface import StopInterface
from .stops.store import StopStore
from .transport.call_queue import Worker
from .transport.event_loop import EventLoop, HostNotFoundError, NoAnswerError

NODE_NAME = "hero_driver"

REGISTRAR_QUEUE_LENGTH = 20000
"""Topics that may wait for the ROS master: 200 robots of 24 topics that come, leave and come again."""

SWITCH_INTERVAL_S = 0.001
"""Time limit of other threads on the GIL while the thread of the sockets waits; Python's 5 ms delay robots."""

REPORT_CHECK_S = 0.1

MASTER_CHECK_S = 0.5
"""Time between two looks for the ROS master at the start."""

HANG_WAIT_S = 1.0
"""The loop ends within milliseconds of the stop of the robots, unless it hangs."""

LEAVE_WAIT_S = 3.0
"""Time limit for unregistering at the ROS master; 50 robots take 0.5 s."""


def make_ros_clock() -> Callable[[], int]:
    """Return a function that gives ROS time in nanoseconds: simulated where /use_sim_time is set."""
    if rospy.get_param("/use_sim_time", False):
        return lambda: rospy.Time.now().to_nsec()
    return time.time_ns


class DriverNode:
    """The whole driver: open() until close()."""

    def __init__(self, config: DriverConfig, log: LogRelay, threads: ThreadWatch) -> None:
        """Serve nothing before open(); for the time after rospy.init_node()."""
        self._config = config
        self._threads = threads
        # Not an Event: a signal handler that interrupts the waiting thread would wait for the Event's lock for ever.
        self._ends: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._changed = threading.Event()
        self._log = log
        failure, tell = "a topic or service could not be set up", functools.partial(log.log, "error")
        self._registrar = Worker("registrar", REGISTRAR_QUEUE_LENGTH, failure, tell)
        self._loop = EventLoop(config.host, config.port, config.silence_timeout_s)
        self._gateway = Gateway(
            config, self._loop, log, self._registrar, rospy.get_name(), make_ros_clock(), self._changed.set
        )
        self._thread = threading.Thread(target=self._run_loop, name="sockets", daemon=True)
        self._crash: Optional[BaseException] = None
        self._stop_store = StopStore(rospy.get_name(), ros.read_master_uri())
        self._stop_interface = StopInterface(self._loop, self._gateway, self._stop_store, self._log)
        self._is_closed = threading.Event()

    def open(self) -> None:
        """Listen and serve. Raises: ProgramError if the port cannot be had."""
        try:
            self._loop.open(self._gateway)
        except OSError as error:
            raise ProgramError(_explain_bind_error(self._config, error)) from error
        self._gateway.open()
        since_s = self._stop_store.read_since() if self._config.start_stopped == "as_before" else None
        self._stop_interface.open(since_s is not None or self._config.start_stopped == "always", since_s)
        self._thread.start()
        rospy.Service("~dismiss_gone", Trigger, self._serve_dismissal)
        ros.MasterWatch().start(
            self._is_closed,
            lambda news: self._log.log("warn", news),
            lambda loss: self._log.log("error", f"{loss}; programs that start now find no robots"),
        )
        self._log.log("info", f"hero_driver: listening on {self._loop.listening}")
        for problem in self._config.calibration_problems.values():
            self._log.log("warn", f"a calibration is not used: {problem}, then restart the driver")
        # Whatever ~host calls it: "0" is every address too.
        if self._loop.listening.host in ("0.0.0.0", "::") and not self._config.allow:
            self._log.log(
                "warn",
                "any host in the networks of this PC can pose as a robot: ~host or ~allow limits them to the robots'",
            )

    def spin(self) -> int:
        """Report until end() is called; return the exit code."""
        reporter = Reporter()
        next_report_s = time.monotonic()
        # The first reports of a burst of changes may be put off a little, so that 50 robots make a few.
        while not self._has_ended(REPORT_CHECK_S) and not self._threads.failure:
            now_s = time.monotonic()
            is_due = now_s >= next_report_s
            if is_due or self._changed.is_set():
                self._changed.clear()
                self._report(reporter, is_due)
            if is_due:
                next_report_s = now_s + self._config.report_period_s
        if self._crash is not None:
            rospy.logfatal("the driver broke: %s: %s", type(self._crash).__name__, self._crash)
            return 1
        if self._threads.failure:
            rospy.logfatal("hero_driver ends, as programs could not stop robots any more: %s", self._threads.failure)
            return 1
        return 0

    def end(self) -> None:
        """Make spin() return; from any thread or signal handler."""
        self._ends.put(None)

    def close(self) -> None:
        """Stop all robots, then close their connections; safe to call twice."""
        if self._thread.is_alive():
            self._loop.stop()
            self._thread.join(STOP_LIMIT_S + HANG_WAIT_S)
            if self._thread.is_alive():
                self._log.log("error", "the driver ends, and could not stop the robots: its loop hangs")
        self._stop_interface.close()
        self._is_closed.set()
        self._registrar.close()
        self._log.close()

    def _has_ended(self, timeout_s: float) -> bool:
        """Wait for end(), at most for timeout_s; return whether it was called."""
        try:
            self._ends.get(timeout=timeout_s)
        except queue.Empty:
            return False
        return True

    def _run_loop(self) -> None:
        try:
            self._loop.run()
        except BaseException as error:  # the node must end when its only worker does
            self._crash = error
            self.end()
            raise

    def _serve_dismissal(self, request: Any) -> TriggerResponse:
        del request
        try:
            names = self._loop.ask(self._gateway.dismiss_gone, 1.0)
        except NoAnswerError:
            return TriggerResponse(False, "the driver hangs")
        return TriggerResponse(True, f"no longer listed as gone: {', '.join(names) or 'no robot'}")

    def _report(self, reporter: Reporter, is_periodic: bool) -> None:
        try:
            status = self._loop.ask(self._take_status, 1.0)
        except NoAnswerError:
            return
        if is_periodic:
            reporter.measure_rates(status)
        try:
            reporter.publish(status)
        except rospy.ROSException:
            if not rospy.core.is_shutdown_requested():
                raise
            return  # another program ends the node (rosnode kill): rospy closes topics before it calls end()
        if is_periodic:
            reporter.diagnose()

    def _take_status(self, answer: Callable[[FleetStatus], None]) -> None:
        """Runs on the thread of the sockets."""
        now_s, gateway = time.monotonic(), self._gateway
        message = RobotArray(
            listening=str(self._loop.listening),
            stopped=gateway.stopped,
            stopped_by=self._stop_interface.stopped_by,
            gone=[status.message for status in gateway.list_gone(now_s)],
        )
        if self._stop_interface.stopped_s is not None:
            message.stopped_since = find_stamp(self._stop_interface.stopped_s, now_s)
        robots, refused = gateway.list_robots(now_s), gateway.refused_connections
        answer(FleetStatus(now_s, message, robots, len(gateway.peers), refused, gateway.last_refusal))


def main(argv: Optional[List[str]] = None) -> int:
    """Run the node; return its exit code."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        # Into a pipe or file Python writes nothing before it has 8 kB, and rospy does not flush.
        sys.stdout.reconfigure(line_buffering=True)
    threads = ThreadWatch()
    try:
        code = _run(argv, threads)
    except (MemoryError, RuntimeError, ProgramError) as error:
        if not threads.note(error) and not threads.failure:
            raise
        print_error(f"cannot run: {threads.failure}")
        code = 1
    if threads.failure:
        os._exit(code)  # Python would wait for rospy's threads, which wait for what could not start
    return code


def _run(argv: Optional[List[str]], threads: ThreadWatch) -> int:
    log = LogRelay()
    try:
        _enter_ros(argv, log)
        node = DriverNode(read_config(ros.read_given()), log, threads)
        sys.setswitchinterval(SWITCH_INTERVAL_S)
        # The driver handles signals itself: robots are stopped before ROS goes down.
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: node.end())
        rospy_internals.call_before_shutdown(node.end)
        node.open()
    except KeyboardInterrupt:
        return 130
    except ProgramError as error:
        if threads.failure:
            raise
        rospy.logfatal("hero_driver cannot start: %s", error)
        return 2
    try:
        return node.spin()
    finally:
        node.close()
        if not threads.failure:
            ros.end_ros_node("the driver ended", LEAVE_WAIT_S)


def _enter_ros(argv: Optional[List[str]], log: LogRelay) -> None:
    """Become a ROS node. Raises: ProgramError where the environment does not allow it."""
    _wait_for_master(ros.read_master_uri())
    running = ros.find_running_node(NODE_NAME)
    if running:
        text = "a driver already runs as %s: end it, or start this one with another name:= and port:= (simulated robots"
        raise ProgramError(text % running + " alone: roslaunch hero_sim hero_sim.launch)")
    report_dropped_log_lines()
    ros.limit_xmlrpc_connections()
    ros.open_tcpros_server(lambda host, text: log.log_throttled("warn", "handshake " + host, text))
    rospy_internals.keep_publishers_connected()
    ros.init_ros_node(NODE_NAME, arguments=argv)
    rospy_internals.leave_topics_out_of_rosout()


def _wait_for_master(uri: str) -> None:
    """Return when a ROS master answers; rospy would wait too, but could not be interrupted."""
    if rosgraph.is_master_online():
        return
    sys.stderr.write(
        f"hero_driver: no ROS master at {uri} yet, waiting; start one with roscore, or set ROS_MASTER_URI\n"
    )
    while not rosgraph.is_master_online():
        time.sleep(MASTER_CHECK_S)


def _explain_bind_error(config: DriverConfig, error: OSError) -> str:
    where = f"~host {config.host}, ~port {config.port}"
    if error.errno == errno.EADDRINUSE:
        remedy = f"end the other program (ss -ltnp 'sport = :{config.port}' names it) or choose another ~port"
        return f"{where} is in use: {remedy}"
    if error.errno == errno.EACCES:
        return f"{where} may not be used without privileges: choose a ~port above 1023"
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{where} is not an address of this machine: use one that `ip address` shows, or 0.0.0.0"
    if isinstance(error, HostNotFoundError):
        return f"{where}: {error}; use an address that `ip address` shows, or 0.0.0.0"
    return f"{where} cannot be listened on: {os.strerror(error.errno) if error.errno else error}"
