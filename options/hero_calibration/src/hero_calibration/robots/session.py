"""Takes all robots through a procedure together: each step moves all of them, and the data of each is evaluated alone.

A robot that fails is stopped, keeps its reason, and is excluded; the others continue. Knows neither ROS nor the
clock of this computer: a subclass has the time, and waits (ros_session).
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Callable, Dict, List, Optional, Sequence, TypeVar

from hero_client.values import SEND_TIME_S
from hero_node import Clock, say

from ..errors import CalibrationError, EndedError
from .probe import Probe

T = TypeVar("T")
M = TypeVar("M")

POLL_S = 0.02
SETTLE_S = 0.6
COMMAND_PERIOD_S = 0.1
CALLS_AT_ONCE = 32


class Session(Clock):
    """The robots under calibration (probes), also those that failed, and the clock.

    Its sleep() takes the whole time also while the program ends.
    """

    def __init__(self, probes: Sequence[Probe]) -> None:
        self.probes = list(probes)

    def map(self, work: Callable[[Probe], None], probes: Sequence[Probe]) -> None:
        """Do work for probes side by side: a service call waits for its robot."""
        with ThreadPoolExecutor(CALLS_AT_ONCE) as pool:
            list(pool.map(work, probes))

    def pause(self, duration_s: float) -> None:
        """Wait. Raises: EndedError if the program is to end."""
        self.wait_for(lambda: False, duration_s)

    def wait_for(self, condition: Callable[[], bool], timeout_s: float) -> None:
        """Wait until condition holds, at most timeout_s. Raises: EndedError if the program is to end."""
        end_s = self.now_s + timeout_s
        while not condition():
            left_s = end_s - self.now_s
            if left_s <= 0.0:
                return
            if not self.sleep(min(left_s, POLL_S)):
                raise EndedError

    @property
    def active(self) -> List[Probe]:
        """Robots that have not failed."""
        return [probe for probe in self.probes if probe.failure is None]

    def for_each(self, step: str, work: Callable[[Probe], T], probes: Optional[Sequence[Probe]] = None) -> Dict[int, T]:
        """Do work for robots (None: all active) side by side; return the results by robot.

        A CalibrationError fails that robot alone, which is stopped; one that has failed keeps its first reason.
        """
        probes = self.active if probes is None else probes
        results: Dict[int, T] = {}

        def work_on(probe: Probe) -> None:
            try:
                results[probe.robot_id] = work(probe)
            except CalibrationError as error:
                probe.stop()
                if probe.failure is None:
                    probe.failure = f"{step}: {error}"
                    say(f"{probe.name} failed: {probe.failure}")

        self.map(work_on, probes)
        return results

    def repeat(
        self,
        step: str,
        tries: int,
        move: Callable[[Sequence[Probe]], M],
        evaluate: Callable[[Probe, M, bool], T],
        results: Optional[Dict[int, T]] = None,
    ) -> Dict[int, T]:
        """Move robots and evaluate their data; those whose data is unusable try again, and fail in the end.

        Wi-Fi stalls for a second now and then, and delays readings and commands. evaluate receives what move returned,
        and whether this is the last try. Return the results by robot, in results (None: new): there they are also if
        the program is ended meanwhile.
        """
        results = {} if results is None else results
        waiting = self.active
        for left in reversed(range(tries)):
            moved = move(waiting)

            def try_evaluating(probe: Probe, moved: M = moved, is_last: bool = not left) -> None:
                try:
                    results[probe.robot_id] = evaluate(probe, moved, is_last)
                except CalibrationError as error:
                    if is_last:
                        raise
                    probe.check_alive(self.now_s)
                    say(f"{probe.name} once more: {step}: {error}")

            self.for_each(step, try_evaluating, [probe for probe in waiting if probe.failure is None])
            waiting = [probe for probe in self.active if probe.robot_id not in results]
            if not waiting:
                break
        return results

    def stop(self) -> None:
        """Stop all robots, including those that failed; works while the program ends."""
        for probe in self.probes:
            probe.stop()
        self.sleep(SEND_TIME_S)

    def settle(self) -> None:
        """Stop all robots and wait until they are at rest."""
        for probe in self.active:
            probe.stop()
        self.pause(SETTLE_S)
