"""Calibrates all robots of a session part by part, keeps what was measured, and prints a table. Knows no ROS."""

import importlib.util
import os
import time
from typing import Any, Dict, List, Optional, Sequence

from hero_node import say
from hero_node.files import KeptCalibration, replace_file

from . import store
from .errors import CalibrationError, EndedError
from .procedures.infrared import calibrate_infrared
from .procedures.motors import MotorResult, calibrate_motors
from .procedures.placement import Ask, place_robots
from .procedures.velocity import calibrate_velocity
from .procedures.wheels import ROOM, WheelResult, calibrate_wheels
from .robots.probe import Probe
from .robots.session import Session

MOTORS, VELOCITY, INFRARED, WHEELS = "motors", "velocity", "infrared", "wheels"
DEFAULT_PARTS = (MOTORS, VELOCITY, INFRARED)
PARTS = (*DEFAULT_PARTS, WHEELS)


class Calibration:
    """One run over all robots."""

    def __init__(
        self, session: Session, parts: Sequence[str], folder: str, ask: Optional[Ask], tape: Optional[Ask] = None
    ) -> None:
        """Calibrate parts of PARTS, with files in folder; ask: None if the robots are placed already.

        tape: asks for what is measured with a tape; None: localize tells where robots are.
        """
        self._tape = tape
        self._session = session
        self._parts = parts
        self._folder = folder
        self._ask = ask
        self._results: Dict[int, Dict[str, Any]] = {}
        self._files: Dict[int, List[str]] = {}

    def run(self) -> int:
        """Calibrate, save, and print a table; return the exit code. Raises: CalibrationError."""
        probes = self._session.probes
        ended = False
        try:
            self._calibrate()
        except EndedError:
            ended = True
        finally:
            self._session.stop()
            # Robots hold what was measured before the end, whatever caused it: the files must, too.
            for probe in probes:
                if probe.robot_id in self._results:
                    self._save(probe)
        say("\n" + "\n".join(line for probe in probes for line in self._describe(probe)))
        if ended:
            say("ended early: robots hold what the table shows, and keep the rest")
            return 130
        return 1 if any(probe.failure for probe in probes) else 0

    def _calibrate(self) -> None:
        session, parts = self._session, self._parts
        motors: Dict[int, MotorResult] = {}
        if MOTORS in parts or VELOCITY in parts:
            place_robots(session, at_wall=False, ask=self._ask)
        if MOTORS in parts and session.active:
            try:
                calibrate_motors(session, motors)
            finally:
                self._store(MOTORS, motors)
        if VELOCITY in parts and session.active:
            self._store(VELOCITY, calibrate_velocity(session, motors))
        if WHEELS in parts and session.active:
            say(ROOM)
            place_robots(session, at_wall=False, ask=self._ask)
            self._store(WHEELS, calibrate_wheels(session, self._tape))
        if INFRARED in parts and session.active:
            place_robots(session, at_wall=True, ask=self._ask)
            self._store(INFRARED, calibrate_infrared(session))

    def _store(self, part: str, results: Dict[int, Any]) -> None:
        for robot_id, result in results.items():
            self._results.setdefault(robot_id, {})[part] = result

    def _save(self, probe: Probe) -> None:
        results = self._results[probe.robot_id].values()
        path = store.name_file(self._folder, probe.robot_id)
        picture = os.path.splitext(path)[0] + ".png"
        values = {key: numbers for result in results for key, numbers in result.to_file().items()}
        date = time.strftime("%Y-%m-%d %H:%M:%S")
        try:
            store.save(path, KeptCalibration(probe.robot_id, date, values, {"model": probe.model}))
            self._files[probe.robot_id] = [path]
            if importlib.util.find_spec("matplotlib") is not None:
                from .figures import draw_robot

                drawn = [result for result in results if not isinstance(result, WheelResult)]
                if drawn:
                    with replace_file(picture) as file:
                        draw_robot(probe.name, drawn).savefig(file, dpi=120, format="png")
                    self._files[probe.robot_id].append(picture)
        except CalibrationError as error:
            probe.failure = probe.failure or str(error)
        except OSError as error:
            probe.failure = probe.failure or f"{picture} cannot be written: {error.strerror}"

    def _describe(self, probe: Probe) -> List[str]:
        """Return the lines of a robot in the final table."""
        return [
            f"{probe.name}: {'FAILED: ' + probe.failure if probe.failure else 'ok'}",
            *(f"  {part:9} {r.describe()}" for part, r in self._results.get(probe.robot_id, {}).items()),
            *("  " + path for path in self._files.get(probe.robot_id, [])),
        ]
