"""Takes all robots through a procedure together: each step moves all of them, and the data of each is evaluated alone.

A robot that fails is stopped, keeps its reason, and takes no further part; the others go on. Time is ROS time, which
may be simulated.
"""

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Callable, List, Optional, Sequence

import rospy

from hero_client.command_line import say
from hero_client.program import Program

from .errors import CalibrationError, EndedError
from .probe import Probe

POLL_S = 0.02
SETTLE_S = 0.6
COMMAND_PERIOD_S = 0.1
STOP_GAP_S = 0.15
"""Between two stops: the robot drops a command within 50 ms of another."""


class Session:
    """The robots under calibration, and the clock.

    Attributes:
        probes: all robots, including those that failed.
    """

    def __init__(self, program: Program, probes: Sequence[Probe]) -> None:
        """Work with probes until program ends."""
        self.program = program
        self.probes = list(probes)

    @property
    def active(self) -> List[Probe]:
        """Robots that have not failed."""
        return [probe for probe in self.probes if probe.failure is None]

    def pause(self, duration_s: float) -> None:
        """Wait in ROS time. Raises: EndedError if the program is to end."""
        end_s = rospy.get_time() + duration_s
        while True:
            left_s = end_s - rospy.get_time()
            if left_s <= 0.0:
                return
            if not self.program.sleep(min(left_s, POLL_S)):
                raise EndedError

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> None:
        """Wait until condition holds, at most timeout_s in ROS time. Raises: EndedError if the program is to end."""
        end_s = rospy.get_time() + timeout_s
        while rospy.get_time() < end_s and not condition():
            self.pause(POLL_S)

    def for_each(self, step: str, work: Callable[[Probe], None], probes: Optional[Sequence[Probe]] = None) -> None:
        """Do work for robots (None: all active) in parallel; a CalibrationError fails that robot alone."""
        probes = self.active if probes is None else probes
        if not probes:
            return

        def work_on(probe: Probe) -> None:
            try:
                work(probe)
            except CalibrationError as error:
                probe.failure = "%s: %s" % (step, error)

        with ThreadPoolExecutor(min(32, len(probes))) as pool:
            list(pool.map(work_on, probes))
        for probe in probes:
            if probe.failure is not None:
                probe.drive(0.0)
                say("%s failed: %s" % (probe.name, probe.failure))

    def repeat(
        self,
        step: str,
        tries: int,
        move: Callable[[Sequence[Probe]], None],
        evaluate: Callable[[Probe, bool], None],
    ) -> None:
        """Move robots and evaluate their data; those whose data is unusable try again, and fail in the end.

        Wi-Fi stalls for a second now and then, and delays readings and commands. evaluate is told whether this is the
        last try.
        """
        waiting = self.active
        for left in reversed(range(tries)):
            again: List[Probe] = []

            def try_evaluating(probe: Probe, is_last: bool = not left, again: List[Probe] = again) -> None:
                try:
                    evaluate(probe, is_last)
                except CalibrationError as error:
                    if is_last:
                        raise
                    probe.check_alive()
                    say("%s once more: %s: %s" % (probe.name, step, error))
                    again.append(probe)

            move(waiting)
            self.for_each(step, try_evaluating, waiting)
            waiting = again
            if not waiting:
                return

    def stop(self) -> None:
        """Stop all robots, including those that failed; works while the program ends."""
        for _ in range(2):
            for probe in self.probes:
                probe.drive(0.0)
            time.sleep(STOP_GAP_S)

    def settle(self) -> None:
        """Stop all robots and wait until they are at rest."""
        for _ in range(2):
            for probe in self.active:
                probe.drive(0.0)
            self.pause(SETTLE_S / 2.0)
