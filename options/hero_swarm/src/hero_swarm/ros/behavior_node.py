"""Program behavior: runs one behavior on robots, by the poses that localize or the simulator gives them.

rosrun hero_swarm behavior _behavior:=milling _robots:=0-9 _frame:=map
"""

import time
from typing import Any, Optional, Tuple

import numpy as np
import rospy
from std_msgs.msg import Float32
from visualization_msgs.msg import MarkerArray

from hero_client import Program, ProgramError, Swarm, read_parameters
from hero_client.swarm import open_swarm
from hero_client.values import BODY_RADIUS_M, PlacedObjects
from hero_node.parameters import choice, number, robot_ids, string, whole_number
from hero_node.ros import read_duration_clock_s
from hero_sim.world import build_default, load_arena

from ..behavior import Behavior, Objects, Random
from ..behaviors import make_behavior
from ..control import Control
from ..metrics.own import State, measure_metric
from ..safety import FENCE, MODES, OFF, ROBOTS, SafetyFilter
from ..sources import Sources
from .behavior_markers import BehaviorMarkers
from .own_readings import OwnReadings
from .pose_source import ObjectSource, OtherRobots, PoseSource
from .wheel_commands import WheelCommands

SHOW_PERIOD_S = 0.1


def _make_behavior(parameters: Any) -> Behavior:
    try:
        return make_behavior(parameters["behavior"], parameters["parameters"])
    except ValueError as error:
        raise ProgramError("~" + str(error)) from None


def _parse_fence(text: str) -> Optional[np.ndarray]:
    """Return x min, y min, x max, y max; None for no fence. Raises: ProgramError."""
    if not text.strip():
        return None
    try:
        bounds_m = np.array([float(word) for word in text.split()])
    except ValueError:
        bounds_m = np.empty(0)
    if bounds_m.shape != (4,) or not np.isfinite(bounds_m).all() or (bounds_m[2:] <= bounds_m[:2]).any():
        raise ProgramError(f'~fence is {text!r}, but must be "x_min y_min x_max y_max" in m')
    return bounds_m


def _make_filter(parameters: Any) -> SafetyFilter:
    """Return the filter of ~safety and ~fence. Raises: ProgramError if they do not go together."""
    mode, fence_m = parameters["safety"], _parse_fence(parameters["fence"])
    if mode == FENCE and fence_m is None:
        raise ProgramError('~safety is fence, but ~fence is empty: give "x_min y_min x_max y_max" in m')
    if mode == OFF and fence_m is not None:
        raise ProgramError(f'~fence is {parameters["fence"]!r}, but ~safety is off: set it to "fence"')
    return SafetyFilter(mode, fence_m)


class BehaviorNode:
    """One behavior on one swarm.

    Attributes:
        behavior: with the numbers that were given.
        control: its loop, which step() steps.
    """

    def __init__(self, swarm: Swarm, parameters: Any) -> None:
        """Begin; robots are stopped until their poses are known. Raises: ProgramError for a wrong parameter."""
        self._swarm = swarm
        self.behavior = _make_behavior(parameters)
        self._frame = parameters["frame"]
        ids = [robot.robot_id for robot in swarm]
        self._source = PoseSource(ids, self._frame)
        are_needed = any(isinstance(sensor, Objects) for sensor in self.behavior.sensors().values())
        self._objects = ObjectSource(self._frame, parameters["object_radius_m"], are_needed)
        self._filter = _make_filter(parameters)
        self._others = OtherRobots(ids, self._frame) if self._filter.mode == ROBOTS else None
        folder, simulated = parameters["calibration_folder"], parameters["simulated"]
        self._commands = WheelCommands(swarm, self.behavior.drive, folder, simulated)
        random, readings = Random([parameters["seed"]], len(ids)), OwnReadings(swarm, self.behavior.sensors())
        arena = parameters["arena"] or self.behavior.arena
        self._arena = load_arena(arena) if arena else build_default(simulated) if simulated else None
        self.control = Control(self.behavior, random, self._filter, robots=readings, arena=self._arena)
        self._start_s = read_duration_clock_s()
        self._last: Optional[Tuple[float, np.ndarray]] = None
        self._sources = Sources()
        self._next_show_s = 0.0
        self._colors: Optional[np.ndarray] = None
        self._metric = rospy.Publisher("~metric", Float32, queue_size=5)
        self._drawing = BehaviorMarkers(self.behavior, self._frame, rospy.get_name())
        self._markers = rospy.Publisher("behavior/markers", MarkerArray, queue_size=2)

    def step(self) -> None:
        """Sense, decide, and command all robots."""
        poses, ages_s = self._source.read()
        things = self._objects.read()
        if self._objects.are_needed and not len(things.radii_m):
            poses, things = np.full_like(poses, np.nan), PlacedObjects(np.full((1, 1, 3), np.nan), np.ones(1))
        now_s = read_duration_clock_s()
        self._filter.set_models([robot.model for robot in self._swarm])
        if self._others:
            self._filter.others_m = self._others.read()
        speeds = self.control.step(now_s - self._start_s, poses[None], things, ages_s[None])
        is_known = np.isfinite(poses).all(axis=1)
        may_move = is_known & np.isfinite(self.control.wanted).all(axis=0)
        self._commands.send(speeds[0], speeds[1], may_move)
        late = self.control.lateness.take_warning()
        if late:
            rospy.logwarn(late)
        if not may_move.all():
            name = self._swarm.robots[int(may_move.argmin())].name
            missing = self._objects.describe_missing() or self._source.describe_missing()
            missing = missing or f"the behavior gives {name} a speed that is no finite number"
            self._source.warn(missing + "; the robots are stopped meanwhile")
        elif self._others and self._others.describe_missing():
            self._source.warn(self._others.describe_missing())
        elif self._filter.is_limited.any():
            row = int(self._filter.is_limited[0].argmax())
            text = (
                "the behavior asks %s for %.3g m/s and %.3g rad/s, more than it can drive: it drives this curve slower"
            )
            self._source.warn(text % (self._swarm.robots[row].name, *self.control.wanted[:, row]))
        if not self.control.has_decided:
            return
        self._show_colors()
        if time.monotonic() >= self._next_show_s and is_known.any():
            self._next_show_s = time.monotonic() + SHOW_PERIOD_S
            self._show(now_s, poses, things)

    def _show(self, now_s: float, poses: np.ndarray, things: PlacedObjects) -> None:
        """Publish the metric of the robots whose poses are known, and what RViz and the monitor draw."""
        last_s, last = self._last or (now_s - SHOW_PERIOD_S, poses)
        velocities = (poses - last) / max(now_s - last_s, 1e-3)
        self._last = now_s, poses
        known = np.isfinite(velocities).all(axis=1)
        if not known.any():
            return
        measured = poses[None, known], velocities[None, known], things.poses, BODY_RADIUS_M, self._arena
        control = self.control
        state = State(now_s - self._start_s, *measured, control.sensed, control.memory, control.colors)
        value = float(measure_metric(self.behavior.metric, state, self._sources)[0])
        self._metric.publish(Float32(value))
        markers = self._drawing.draw(poses, self.control.sensed, value)
        if self._markers.get_num_connections():
            self._markers.publish(MarkerArray(markers))

    def _show_colors(self) -> None:
        colors = self.control.colors
        if colors is None:
            return
        for row, (robot, color) in enumerate(zip(self._swarm, colors)):
            if self._colors is None or (self._colors[row] != color).any():
                robot.led(tuple(color.tolist()))
        self._colors = colors.copy()


PARAMETERS = {
    "behavior": string("aggregation", "a built-in behavior, FILE.py, FILE.py:Class, or FILE.controller"),
    "parameters": {},
    "robots": robot_ids("all", "ids; all: those that have joined a driver"),
    "frame": string("map", "frame of the poses: that of localize, or `world` for the simulator's ground truth"),
    "arena": string("", "a name or file of the simulator, for Floor, Light, Pheromone and wall_following"),
    "object_radius_m": number(0.05, 0.001, 5.0, "m", "of the circle around an object"),
    "safety": choice("off", MODES, "safety filter: off, fence, or fence and robots"),
    "fence": string("", "x min, y min, x max, y max of the fence, m"),
    "calibration_folder": string("~/hero_calibration", "of `calibrate`; behaviors with drive = pulses need its files"),
    "simulated": whole_number(0, 0, 1000, "", "robots of a simulator with seed 0, whose motors count as calibrated"),
    "seed": whole_number(0, 0, 2**31 - 1, "", "of the behavior's random numbers"),
    "time_s": number(0.0, 0.0, 1e6, "s", "stop after this time; 0 runs until Ctrl-C"),
}


def main() -> None:
    """Run the behavior until the program is to end. Raises: ProgramError for a wrong parameter."""
    with Program("behavior") as program:
        parameters = read_parameters(PARAMETERS)
        _make_behavior(parameters)
        if _make_filter(parameters).mode == ROBOTS and not parameters["fence"].strip():
            rospy.logwarn("~fence is not given: robots are kept apart, but may drive anywhere")
        with open_swarm(program, parameters["robots"], odom=False, proximity=False) as swarm:
            node = BehaviorNode(swarm, parameters)
            end_s = parameters["time_s"] or np.inf
            text = "%s drives %d robots; its metric, %s, is on %s"
            made = node.behavior
            rospy.loginfo(text, type(made).__name__, len(swarm), made.metric, rospy.resolve_name("~metric"))
            for time_s in program.rate(node.control.rate_hz):
                if time_s >= end_s:
                    break
                node.step()
