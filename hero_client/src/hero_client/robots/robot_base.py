"""One robot as an object, whatever connects it: see robot. Pure.

Units: m, rad, s. Frames (REP 103, 105): poses are in hero_N/odom, velocities and ranges in hero_N/base_link: x to the
front, y to the left, angles counter-clockwise from the front.
"""

import math
from contextlib import suppress
from functools import partial
from typing import Callable, Generator, Optional

from hero_node import Pose, clamp, transform_pose
from hero_node.parameters import check_finite, check_speed
from hero_node.robot_constants import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S

from ..controllers.go_to_goal import DEFAULT_TOLERANCE_M, Goal, GoToGoalController, make_goal
from ..controllers.motion import DEFAULT_TIMEOUT_S, MotionController, State
from ..controllers.straight_and_turn import ForwardController, TurnController
from ..values.background_motion import BackgroundMotion, Sleep, Steps
from ..values.colors import Color
from ..values.errors import GoalError, StaleDataError, StoppedError
from ..values.readings import FRESH_S, NOT_CALIBRATED, is_blind
from ..values.robot_link import RobotLink
from .group import POLL_PERIOD_S, READY_TIMEOUT_S, REPEAT_PERIOD_S, carry_out, wait_for_all
from .light import Light
from .robot_readings import NEXT_ODOM_S, RobotReadings

WARNING_PERIOD_S = 5.0

COMMAND_S = 2.0
"""A robot obeys a command that no other follows for this long."""

OnStep = Callable[[GoToGoalController], None]


class BaseRobot(RobotReadings):
    """One robot: what Robot has that needs no ROS.

    Attributes:
        robot_id: the number, 3.
        name: "hero_3".
        namespace: "/hero_3".
        driven: whether a command was sent from here; a robot that was only watched is not stopped at the end.
    """

    def __init__(self, robot_id: int, link: RobotLink) -> None:
        """link leads to the robot with this id, and tells the time by which it is waited for."""
        self.robot_id = robot_id
        self.name = "hero_%d" % robot_id
        self.namespace = "/" + self.name
        self.driven = False
        self._link = link
        self._clock = link.clock
        self._members = (self,)
        self._light = Light(link)
        self._motion: Optional[BackgroundMotion] = None
        self._next_warning_s = -math.inf
        self._first_data_s = self.now_s + READY_TIMEOUT_S
        self._moves_sent = 0
        self._last_move_s = -math.inf
        self._is_clipped = False

    def set_pose(self, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Set the odometry: from now on the robot is at this pose of hero_N/odom. Returns when `pose` says so.

        Raises: RobotError if the robot does not answer or refuses. StaleDataError if no odometry follows.
        """
        check_finite("x, y and yaw of a pose", x_m, y_m, yaw_rad)
        self._link.set_odometry(Pose(x_m, y_m, yaw_rad))
        self._link.subscribe("odom")
        self._link.wait_for_next("odom", NEXT_ODOM_S, count=2)  # one may have been on its way before the answer

    def drive(self, linear_m_s: float, angular_rad_s: float, duration_s: Optional[float] = None) -> None:
        """Drive with these velocities, limited to 0.20 m/s and 8 rad/s.

        linear_m_s is positive forward, angular_rad_s positive to the left. With duration_s, drive for this time, then
        stop. Without, send one command and return: the robot obeys it until the next one, for about 2 s at most.
        A robot speeds up within about 0.5 s, so 0.1 m/s for 2 s is a little less than 0.2 m: see forward().

        Without duration_s it never waits: a command that comes before the driver's subscription, as at the start of a
        program, is sent with it. One that cannot have an effect is logged: if nothing subscribes to it within 3 s of
        the start, or all robots are stopped.

        Raises: ValueError for velocities that are not finite. With duration_s also RobotNotReadyError if the robot is
        not there within 2 s, and StoppedError if all robots are stopped.
        """
        if duration_s is not None:
            self._drive_for(linear_m_s, angular_rad_s, duration_s)
            return
        self._end_motion()
        self._send_velocity(linear_m_s, angular_rad_s)
        if (linear_m_s or angular_rad_s) and self._link.is_stopped:
            self._warn(self._describe_stop())

    def _warn(self, text: str) -> None:
        if text and self.now_s >= self._next_warning_s:
            self._next_warning_s = self.now_s + WARNING_PERIOD_S
            self._link.log_warning(text)

    def _send_velocity(self, linear_m_s: float, angular_rad_s: float) -> None:
        check_finite("speeds", linear_m_s, angular_rad_s)
        self.driven = True
        self._moves_sent = self._moves_sent + 1 if linear_m_s or angular_rad_s else 0
        self._last_move_s = self.now_s
        if not self._is_clipped and (abs(linear_m_s) > MAX_LINEAR_M_S or abs(angular_rad_s) > MAX_ANGULAR_RAD_S):
            self._is_clipped = True
            self._link.log_warning(
                "%s cannot drive %g m/s and %g rad/s: it is limited to %g m/s and %g rad/s"
                % (self.name, linear_m_s, angular_rad_s, MAX_LINEAR_M_S, MAX_ANGULAR_RAD_S)
            )
        self._link.send_velocity(clamp(linear_m_s, MAX_LINEAR_M_S), clamp(angular_rad_s, MAX_ANGULAR_RAD_S))

    def stop_if_blind(self) -> bool:
        """Stop the robot if no sensor is calibrated, and log that every 5 s; return whether so. Raises: as `pose`."""
        if not is_blind(self.proximity):
            return False
        self.drive(0.0, 0.0)
        self._warn(f"{self.name} waits: {NOT_CALIBRATED}")
        return True

    def warn_if_blind(self) -> None:
        """Log every 5 s why a robot that drives by its pose does not see what is in its way."""
        reason = self.missing_ranges()
        if reason and self.missing() is None:
            self._warn(f"{self.name} drives by its pose alone: {reason}")

    def _describe_stop(self) -> str:
        return f"{self.name} does not move: {self._link.describe_stop()}"

    def check_not_stopped(self) -> None:
        """Check that the driver lets the robot move: see is_stopped. Raises: StoppedError with how to release it."""
        if self._link.is_stopped:
            raise StoppedError(self._describe_stop())

    def forward(self, distance_m: float, linear_m_s: float = 0.1) -> None:
        """Drive straight on by distance_m, backwards if it is negative, to within 5 mm by the robot's odometry.

        linear_m_s: the speed, up to 0.2; the robot slows down before the end.

        Raises: GoalError as go_to(). ValueError for a speed that is not positive. RobotNotReadyError. StoppedError.
        """
        steps = self.forward_steps(distance_m, linear_m_s)
        self._end_motion()
        self._run(steps)

    def turn(self, angle_rad: float, angular_rad_s: float = 1.5) -> None:
        """Turn on the spot by angle_rad, positive to the left, to within 0.03 rad by the robot's odometry.

        angular_rad_s: the speed, up to 8; the robot slows down before the end. Angles beyond a full turn are driven.

        Raises: GoalError if the wheels do not turn or odometry ends. ValueError for a speed that is not positive.
        RobotNotReadyError. StoppedError.
        """
        steps = self.turn_steps(angle_rad, angular_rad_s)
        self._end_motion()
        self._run(steps)

    def forward_steps(self, distance_m: float, linear_m_s: float) -> Steps:
        """Return forward() as steps. Raises: ValueError for a speed that is not positive."""
        check_speed(distance_m, linear_m_s)
        controller = ForwardController(distance_m, self.now_s, linear_m_s)
        return carry_out(self._follow(controller, lambda: f"drive {distance_m:g} m"), self._members)

    def turn_steps(self, angle_rad: float, angular_rad_s: float) -> Steps:
        """Return turn() as steps. Raises: ValueError for a speed that is not positive."""
        check_speed(angle_rad, angular_rad_s)
        if abs(angle_rad) > math.tau and float(angle_rad).is_integer():
            text = "%s turns by %g rad, %.1f full turns: for degrees, turn(math.radians(%g))"
            self._link.log_warning(text % (self.name, angle_rad, abs(angle_rad) / math.tau, angle_rad))
        controller = TurnController(angle_rad, self.now_s, angular_rad_s)
        return carry_out(self._follow(controller, lambda: f"turn {angle_rad:g} rad"), self._members)

    def start_motion(self, steps: Steps) -> BackgroundMotion:
        """Take the steps of a motion in the background, in place of the present one; return the motion."""
        self._end_motion()
        self._motion = self._link.start(steps)
        return self._motion

    def go_to(
        self,
        x_m: float,
        y_m: float,
        yaw_rad: Optional[float] = None,
        frame: str = "odom",
        avoid: bool = False,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        tolerance_m: float = DEFAULT_TOLERANCE_M,
        sleep: Optional[Sleep] = None,
        on_step: OnStep = lambda controller: None,
    ) -> None:
        """Drive to a position, turn to yaw_rad if given, and return when the robot has stopped there.

        frame: "odom" for the robot's odometry (0, 0 where it was switched on), "robot" for its present pose (x to the
        front, y to the left), or another frame: see pose_in(). In "map" the place is one of the arena, which odometry
        that drifts does not move.
        avoid: drive around what the proximity sensors see; otherwise the robot stops before an obstacle that is in the
        way, and fails if it stays there for 2 s. The default field of one simulated robot ends 0.7 m from its start.
        on_step: called after each command.

        Raises: GoalError with the reason if the goal is not reached: an obstacle in the way and where it is, wheels
        that do not turn, no pose for 2 s, or timeout_s. RobotNotReadyError if the robot is not there within 2 s.
        StoppedError if all robots are stopped. FrameError as pose_in(). The robot is stopped then.
        """
        steps = self._pursue(make_goal(x_m, y_m, yaw_rad), frame, avoid, timeout_s, tolerance_m, on_step)
        self._end_motion()
        self._run(steps, sleep)

    def start_go_to(
        self,
        x_m: float,
        y_m: float,
        yaw_rad: Optional[float] = None,
        frame: str = "odom",
        avoid: bool = False,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        tolerance_m: float = DEFAULT_TOLERANCE_M,
    ) -> BackgroundMotion:
        """Start go_to() in the background, with the same arguments; return the motion.

        motion.result() waits for its end, and raises what go_to() raises; motion.done() tells whether it has ended;
        motion.cancel(), stop() or another motion of this robot ends it, and result() then raises GoalError. Several
        robots at once: start all, then ask each motion for its result().
        """
        return self.start_motion(self._pursue(make_goal(x_m, y_m, yaw_rad), frame, avoid, timeout_s, tolerance_m))

    def _pursue(
        self,
        goal: Goal,
        frame: str,
        avoid: bool,
        timeout_s: float,
        tolerance_m: float,
        on_step: OnStep = lambda controller: None,
    ) -> Steps:
        if avoid:
            self._link.subscribe("proximity")
        self._link.subscribe("odom")
        yield from wait_for_all(self._members)
        given, read_pose = goal, None
        if frame == "robot":
            place = transform_pose((yield from self._wait_for_pose()), Pose(goal.x_m, goal.y_m, goal.yaw_rad or 0.0))
            goal = Goal(place.x_m, place.y_m, None if goal.yaw_rad is None else place.yaw_rad)
        elif frame.lstrip("/") not in ("odom", self.name + "/odom"):
            with suppress(StaleDataError):
                self.pose_in(frame)  # waits for one that was never there, which the steps do not
            read_pose = partial(self.pose_in, frame, timeout_s=0.0)
        controller = GoToGoalController(goal, self.now_s, tolerance_m, timeout_s, avoid)

        def describe() -> str:
            x_m, y_m = (given if frame == "robot" else controller.goal)[:2]
            return "reach (%g, %g)%s" % (x_m, y_m, "" if frame == "odom" else " in the frame %s" % frame)

        motion = self._follow(controller, describe, read_pose, lambda: on_step(controller))
        yield from carry_out(motion, self._members)

    def _wait_for_pose(self) -> Generator[float, bool, Pose]:
        """Return `pose`. Raises: StaleDataError if it is not fresh for READY_TIMEOUT_S, or at the end."""
        for _ in range(math.ceil(READY_TIMEOUT_S / POLL_PERIOD_S)):
            pose = self.fresh_pose()
            if pose is not None or not (yield POLL_PERIOD_S):
                break
        return pose or self.pose

    def _follow(
        self,
        controller: MotionController,
        describe: Callable[[], str],
        read_pose: Optional[Callable[[], Pose]] = None,
        on_step: Callable[[], None] = lambda: None,
    ) -> Steps:
        """Drive as the controller says to its end. Raises: GoalError, StoppedError.

        describe: returns what the robot is to do, for errors. read_pose: reads a pose that is not the odometry's.
        """
        controller.body_radius_m = self.model.body_radius_m
        while True:
            self.check_not_stopped()
            pose, odometry, absence = None, None, ""
            try:
                pose = read_pose() if read_pose else self.pose
                odometry = self.fresh_pose() if read_pose else None
            except StaleDataError as error:
                absence = f": {error}"
            age_s = self.age_s("odom")
            self._send_velocity(*controller.step(pose, self.fresh_proximity(), self.now_s, odometry, age_s))
            self._warn(controller.lateness.take_warning())
            if controller.is_unseen and self.age_s("proximity") <= FRESH_S:
                self._warn(f"{self.name} does not see what is in its way: {NOT_CALIBRATED}")
            on_step()
            if controller.state is State.REACHED:
                return
            if controller.state is State.FAILED:
                raise GoalError(f"{self.name} did not {describe()}: {controller.reason}{absence}")
            if not (yield REPEAT_PERIOD_S):
                raise GoalError(f"{self.name} did not {describe()}: cancelled")

    def _end_motion(self) -> None:
        """Cancel a motion in the background and wait until it has sent its stops."""
        motion, self._motion = self._motion, None
        if motion is not None:
            motion.cancel_and_wait()

    def led(self, color: Color) -> None:
        """Show a color: a name such as "red" (see colors.COLORS), or (red, green, blue), each 0..1.

        It stays lit until the program ends, and for 15 s more. Raises: ValueError for a color that is not known.
        """
        self._light.show(color)

    def blink(self, color: Color, period_s: float = 1.0) -> None:
        """Blink the light, half of each period on, until led() or the end of the program; returns at once.

        Raises: ValueError for a color that is not known, or a period of less than 0.2 s.
        """
        self._light.blink(color, period_s)

    def _end_light(self) -> None:
        self._light.close()

    def close(self) -> None:
        """Stop the robot, if it was driven from here, and leave its topics; may be called twice."""
        self._leave()
        self._link.close()

    def __repr__(self) -> str:
        """Return the robot's name with its pose, or with why it is not ready; never waits."""
        missing = self.missing()
        if missing and self.now_s < self._first_data_s:
            missing = "connecting"
        state = missing or ("stopped" if self._link.is_stopped else "ready")
        pose = self.fresh_pose()
        return "<%s: %s%s>" % (self.name, state, ", %r" % (pose,) if pose else "")
