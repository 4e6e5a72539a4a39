"""Several robots as one object, whatever connects them: see swarm. Pure."""

import math
from abc import abstractmethod
from itertools import combinations
from typing import Any, Dict, Generic, Iterator, List, Mapping, Optional, Sequence, Tuple, TypeVar, Union

import numpy as np

from hero_node import STOP, Clock, HeroError, Pose, ProgramError
from hero_node.parameters import check_finite

from ..controllers.go_to_goal import DEFAULT_TOLERANCE_M
from ..controllers.motion import DEFAULT_TIMEOUT_S, SILENT_STEPS
from ..controllers.orca import AvoidanceLaw
from ..controllers.pose_check import FROZEN
from ..controllers.swarm_go_to import SwarmGoToController
from ..values.background_motion import BackgroundMotion, Steps
from ..values.colors import Color
from ..values.errors import GoalError
from ..values.robot_link import MAP
from .common_frame import CommonFrame
from .group import REPEAT_PERIOD_S, Group, stop_after, wait_for_all
from .robot_base import BaseRobot

REPORT_PERIOD_S = 5.0
"""Time between two lines on what is waited for."""

POLL_HZ = 10.0

FIRST_REPORT_S = 3.0
"""Most robots answer within a second or two even when all starts at once: no line about those."""

AnyRobot = TypeVar("AnyRobot", bound=BaseRobot)


class BaseSwarm(Group, Generic[AnyRobot]):
    """Several robots: what Swarm has that needs no ROS.

    Attributes:
        robots: list of the robots, in the order of the ids given.
    """

    def __init__(self, robots: Sequence[AnyRobot], clock: Clock) -> None:
        """clock is that of the robots' links: their time passes by it."""
        self.robots = list(robots)
        self._clock = clock
        self._members = self.robots
        self._by_id = {robot.robot_id: robot for robot in self.robots}
        self._reported: Dict[str, str] = {}
        self._next_report_s = self.now_s + FIRST_REPORT_S

    @property
    def poses(self) -> Dict[int, Pose]:
        """The poses of all robots in the frame map, by their ids; needs hero_localization: see Robot.pose_in().

        Raises: FrameError, StaleDataError as Robot.pose_in(), for the first robot whose pose is not known.
        """
        return {robot_id: robot.pose_in(MAP) for robot_id, robot in self._by_id.items()}

    @property
    def pose_array(self) -> np.ndarray:
        """Poses of the robots by their odometry (N, 3): x m, y m, yaw rad, each in hero_N/odom; nan where not fresh.

        Rows are in the order of `robots`, as in velocity_array and proximity_array. In the first 2 s of a Swarm they
        wait for the first data, as Robot.pose does.
        """
        self._await_first("odom")
        return np.array([robot.fresh_pose() or [math.nan] * 3 for robot in self.robots])

    @property
    def velocity_array(self) -> np.ndarray:
        """Velocities of the robots by their odometry (N, 2): linear m/s, angular rad/s; nan where not fresh."""
        self._await_first("odom")
        return np.array([robot.fresh_velocity() or [math.nan] * 2 for robot in self.robots])

    @property
    def proximity_array(self) -> np.ndarray:
        """Ranges of the robots (N, 8), m: see Robot.proximity; nan where not fresh."""
        self._await_first("proximity")
        return np.array([robot.fresh_proximity() for robot in self.robots])

    @property
    def max_body_radius_m(self) -> float:
        """Radius of the widest body: see Robot.model."""
        return max(robot.model.body_radius_m for robot in self.robots)

    def _await_first(self, topic: str) -> None:
        for robot in self.robots:
            robot.await_first(topic)

    def drive(self, linear_m_s: float, angular_rad_s: float, duration_s: Optional[float] = None) -> None:
        """Drive all robots with the same velocities: see Robot.drive()."""
        if duration_s is not None:
            self._drive_for(linear_m_s, angular_rad_s, duration_s)
            return
        for robot in self.robots:
            robot.drive(linear_m_s, angular_rad_s)

    def go_to(
        self,
        x_m: Union[float, Mapping[int, Tuple[float, float]]],
        y_m: Optional[float] = None,
        yaw_rad: Optional[float] = None,
        **options: Any,
    ) -> None:
        """Drive every robot to this place of its own frame, all at once; return when all have ended.

        options: as in Robot.go_to(). With frame="robot" all robots make the same move. With a dict of goals instead of
        x_m and y_m, it is go_to_each().

        Raises: as Robot.go_to(), for the robots that failed; the others reach their goals.
        """
        if isinstance(x_m, Mapping):
            self.go_to_each(x_m, **options)
            return
        if y_m is None:
            raise TypeError("go_to takes x_m and y_m, or the goal of each robot: {0: (0.2, 0.1), 1: (-0.2, 0.1)}")
        self._wait_for([robot.start_go_to(x_m, y_m, yaw_rad, **options) for robot in self.robots])

    def forward(self, distance_m: float, linear_m_s: float = 0.1) -> None:
        """Drive all robots straight on at once; return when all have ended: see Robot.forward().

        Raises: as Robot.forward(), for the robots that failed; the others end their motions.
        """
        steps = [(robot, robot.forward_steps(distance_m, linear_m_s)) for robot in self.robots]
        self._wait_for([robot.start_motion(motion) for robot, motion in steps])

    def turn(self, angle_rad: float, angular_rad_s: float = 1.5) -> None:
        """Turn all robots on the spot at once; return when all have ended: see Robot.turn(). Raises: as forward()."""
        steps = [(robot, robot.turn_steps(angle_rad, angular_rad_s)) for robot in self.robots]
        self._wait_for([robot.start_motion(motion) for robot, motion in steps])

    def go_to_each(
        self,
        goals: Mapping[int, Tuple[float, float]],
        frame: str = MAP,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        tolerance_m: float = DEFAULT_TOLERANCE_M,
    ) -> None:
        """Drive robots to places of one frame, around each other; return when all are there.

            swarm.go_to_each({0: (0.2, 0.1), 1: (-0.2, 0.1)})

        goals: robot's id -> (x m, y m), at least 0.18 m apart (HeRo+: 0.23 m), also from robots without a goal: they
        stay, and the others drive around them. Law: controllers.swarm_go_to.

        Raises: GoalError for goals too near to each other, with the robots that are not there after timeout_s, and with
        one that has no pose for 2 s, or whose pose stays the same although it drives. KeyError for a robot of no swarm.
        FrameError, StoppedError and RobotNotReadyError as Robot.go_to(). All robots are stopped then.
        """
        for robot_id, goal in goals.items():
            if np.shape(goal) != (2,):
                raise TypeError(f"the goal of hero_{robot_id} must be (x m, y m), not {goal!r}")
            check_finite(f"x and y of the goal of hero_{robot_id}", *goal)
            self[robot_id]._end_motion()
        self._run(stop_after(self._go_to_each(goals, frame, timeout_s, tolerance_m), self._members))

    def _go_to_each(
        self, goals: Mapping[int, Tuple[float, float]], frame: str, timeout_s: float, tolerance_m: float
    ) -> Steps:
        yield from wait_for_all(self._members)
        starts = [robot.pose_in(frame)[:2] for robot in self.robots]  # waits for tf or localization, unlike below
        places = [goals.get(robot.robot_id, start) for robot, start in zip(self.robots, starts)]
        law = AvoidanceLaw(body_m=self.max_body_radius_m)
        for (one, place), (other, beside) in combinations(zip(self.robots, places), 2):
            apart_m = math.dist(place, beside)
            if apart_m < law.min_spacing_m and {one.robot_id, other.robot_id} & set(goals):
                text = "the places of %s and %s are %.3f m apart: robots need %.3f m"
                raise GoalError(text % (one.name, other.name, apart_m, law.min_spacing_m))
        controller = SwarmGoToController(places, law, REPEAT_PERIOD_S, tolerance_m)
        end_s = self.now_s + timeout_s
        common = CommonFrame(frame)
        silent_steps: Dict[str, int] = {}
        while not all(controller.arrived):
            for robot in self.robots:
                robot.check_not_stopped()
            lost = self.step_to_goals(controller, common)
            silent_steps = {robot.name: silent_steps.get(robot.name, 0) + 1 for robot in lost}
            for name, steps in silent_steps.items():
                reason = common.missing[name]
                if steps >= SILENT_STEPS or reason == FROZEN:
                    why = reason if reason == FROZEN else f"no pose for 2 s: {reason}"
                    raise GoalError(f"no goal is reached: {name}: {why}")
            if self.now_s > end_s or not (yield REPEAT_PERIOD_S):
                late = [robot.name for robot, arrived in zip(self.robots, controller.arrived) if not arrived]
                why = "cancelled" if self.now_s <= end_s else f"not there after {timeout_s:g} s"
                missing = filter(None, common.missing.values())
                raise GoalError("; ".join([f"no goal is reached by {', '.join(late)}: {why}", *missing]))

    def step_to_goals(self, controller: SwarmGoToController, common: CommonFrame) -> List[AnyRobot]:
        """Send every robot the next command of a controller, by its pose in a frame; call it ten times per second.

        Return the robots whose poses are not known; while there are some, all are stopped.
        """
        poses = [common.pose_of(robot) for robot in self.robots]
        ranges = [robot.fresh_proximity() for robot in self.robots]
        ages_s = [robot.age_s("odom") for robot in self.robots]
        commands = controller.step(poses, ranges, self.now_s, ages_s)
        warning = controller.lateness.take_warning()
        if warning:
            self._log("warn", warning)
        for robot, command in zip(self.robots, commands):
            robot.drive(*command)
            if command != STOP:
                robot.warn_if_blind()
        self.report_missing(common.missing)
        return [robot for robot, pose in zip(self.robots, poses) if pose is None]

    def wait_for_poses(self, common: CommonFrame, clock: Optional[Clock] = None) -> List[Pose]:
        """Return the poses of all robots in a frame as soon as all are known, and log which are waited for.

        clock: a Program, whose end ends the wait. Raises: ProgramError then.
        """
        for _ in (clock or self._clock).rate(POLL_HZ):
            poses = [pose for pose in map(common.pose_of, self.robots) if pose is not None]
            self.report_missing(common.missing)
            if len(poses) == len(self.robots):
                return poses
        raise ProgramError("ended before all robots were there")

    @staticmethod
    def _wait_for(motions: Sequence[BackgroundMotion]) -> None:
        errors = [error for error in (motion.exception() for motion in motions) if error is not None]
        if len(errors) > 1 and all(isinstance(error, HeroError) for error in errors):
            raise GoalError("; ".join(map(str, errors)))
        for error in errors:
            raise error

    def led(self, color: Color) -> None:
        """Show a color on all robots: see Robot.led()."""
        for robot in self.robots:
            robot.led(color)

    def blink(self, color: Color, period_s: float = 1.0) -> None:
        """Blink all lights: see Robot.blink()."""
        for robot in self.robots:
            robot.blink(color, period_s)

    def report_missing(self, missing: Optional[Mapping[str, Optional[str]]] = None) -> None:
        """Log which robots are waited for, every 5 s, and when they answer; call it in every step of a loop.

        missing: robot's name -> what is missing, or None; without it, robot.missing() of each robot.
        """
        if missing is None:
            missing = {robot.name: robot.missing() for robot in self.robots}
        for name in [name for name in self._reported if missing.get(name) is None]:
            self._log("info", f"{name} answers")
            del self._reported[name]
        if self.now_s < self._next_report_s:
            return
        self._next_report_s = self.now_s + REPORT_PERIOD_S
        for name, reason in missing.items():
            if reason is not None:
                self._log("warn", f"{name}: waiting: {reason}")
                self._reported[name] = reason

    @abstractmethod
    def _log(self, level: str, text: str) -> None:
        """Tell users; level is "info" or "warn"."""

    def close(self) -> None:
        """Stop all robots that were driven from here, and leave their topics; may be called twice."""
        self._leave()
        for robot in self.robots:
            robot._link.close()

    def __getitem__(self, robot_id: int) -> AnyRobot:
        if isinstance(robot_id, (slice, str, tuple, list)):
            text = "swarm[3] is hero_3, not swarm[%r]; for several robots: [swarm[robot_id] for robot_id in (0, 1)]"
            raise TypeError(text % (robot_id,))
        if robot_id not in self._by_id:
            names = ", ".join(robot.name for robot in self.robots)
            raise KeyError(f"hero_{robot_id} is not in this swarm: {names or 'it has no robots'}")
        return self._by_id[robot_id]

    def __contains__(self, robot: object) -> bool:
        """Return whether a robot, or its id, is in the swarm."""
        return robot in self.robots or robot in self._by_id

    def __iter__(self) -> Iterator[AnyRobot]:
        return iter(self.robots)

    def __len__(self) -> int:
        return len(self.robots)

    def __repr__(self) -> str:
        """Return the robots' names, and how many are ready."""
        ready = sum(robot.missing() is None for robot in self.robots)
        names = ", ".join(robot.name for robot in self.robots) or "no robots"
        return "<Swarm of %s: %d of %d ready>" % (names, ready, len(self.robots))
