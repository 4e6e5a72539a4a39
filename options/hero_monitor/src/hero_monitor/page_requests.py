"""Carries out the requests of pages, or tells them why not; on the thread of the pages."""

import time
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, Optional, Sequence, Tuple, Union

import rospy

from hero_node import Pose
from hero_node.files import EntryError

from .background import Background
from .control.activity import Activity
from .control.drive_requests import DriveRequests
from .control.offers import OFFERS, check_values, make_arguments, place_robots
from .control.programs import PROGRAMS_MAX, ChildProcess, Programs
from .control.requests import RequestError, is_fresh, read_clock_ms, read_request
from .fleet_feed.feed import FleetFeed
from .parameters import Parameters
from .serving.lesson import Lesson

if TYPE_CHECKING:
    from .serving.server import PageSocket

Request = Dict[str, Any]

GOALS_AT_ONCE = 100

MOVING = ("drive", "goal", "start")
"""Requests that make robots move: with control:=true, of robots that are connected and not stopped."""

NOTED = ("stop", "release", "stop_some", "goal", "start", "end", "record", "code", "withdraw")
"""Requests that are noted with their user, beside drive."""

INERT_S = 2.0
"""After a stop no release counts: the finger that stopped all robots may tap again."""


class RefusedError(Exception):
    """A valid request is not carried out; the message says why."""


class PageRequests:
    """Requests of pages: each kind of requests.REQUESTS has a method _do_KIND."""

    def __init__(
        self,
        parameters: Parameters,
        feed: FleetFeed,
        commander: DriveRequests,
        background: Background,
        hand_over: Callable[..., Any],
        broadcast: Callable[[], None],
        lesson: Optional[Lesson] = None,
    ) -> None:
        """hand_over: calls a function later, on this thread. broadcast: sends to pages what is new to them."""
        self._lesson = lesson
        self.activity = Activity(background)
        self._parameters, self._feed, self._commander = parameters, feed, commander
        self._background, self._hand_over, self._broadcast = background, hand_over, broadcast
        self.programs = Programs(rospy.get_name(), hand_over, self._stop_robots_of)
        self._pending_goals = 0

    def receive(self, page: "PageSocket", text: Union[str, bytes]) -> None:
        """Carry out a request, or tell the page why not."""
        try:
            request = read_request(text)
            if request["do"] == "start":
                request["values"] = check_values(request["program"], request["values"])
        except RequestError as error:
            page.tell("error", f"invalid request ({error}): reload the page")
            return
        do = request["do"]
        if not is_fresh(request, read_clock_ms()):
            if do != "drive":  # a button that is still held sends the next one at once
                page.tell("error", "the request was delayed: nothing was done")
            return
        try:
            self._carry_out(page, request)
            if do in ("stop", "release"):
                page.acknowledge(do)
        except (RefusedError, EntryError) as error:
            page.tell("error", str(error))
            if do == "drive":
                page.end_hold(request["pressed_ms"])

    def _carry_out(self, page: "PageSocket", request: Request) -> None:
        """Carry out a request, if its user may make it. Raises: RefusedError or EntryError."""
        do, robots = request["do"], request.get("robots", ())
        refusal = page.user.role.find_refusal(
            do, self.programs.find_robots(request["number"]) if do == "end" else robots
        )
        if refusal:
            raise RefusedError(refusal)
        self._check(do, robots)
        getattr(self, "_do_" + do)(page, request)
        if do == "drive":
            self.activity.note_drive(page.who, robots)
        elif do in NOTED:
            self.activity.note(page.who, f"{do} {request.get('program', '')}".strip(), robots)

    def _check(self, do: str, robots: Sequence[str]) -> None:
        """Check whether this may be requested now, by any user. Raises: RefusedError."""
        if do not in (*MOVING, "record"):
            return
        if not self._parameters.control:
            raise RefusedError("this monitor is view only: start it with control:=true to drive robots")
        if do == "record":
            return
        missing = [robot for robot in robots if robot not in self._feed.robots]
        if missing:
            raise RefusedError(f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} not connected")
        if self._feed.stopped or not self._commander.may_drive():
            raise RefusedError("all robots are stopped: release them first")
        driver = self.programs.find_driver(robots)
        if driver and do != "goal":
            raise RefusedError(driver)

    # ---------------------------------------------------------------- view and stops

    def _do_show(self, page: "PageSocket", request: Request) -> None:
        page.picture = request["picture"]

    def _do_stop(self, page: "PageSocket", request: Request) -> None:
        """Stop all robots, or release them."""
        verb, stopped_ms = request["do"], self._commander.stopped_ms
        if verb == "release" and stopped_ms is not None and read_clock_ms() - stopped_ms < 1e3 * INERT_S:
            raise RefusedError(f"NOT RELEASED: robots were stopped less than {INERT_S:g} s ago; hold Release again")
        self._feed.stopper = page.user.name or page.who
        self._commander.request_stop(verb == "stop")
        self.end_motions_of_stopped_robots()
        self._feed.read_stop()
        # After the acknowledgement has left.
        self._hand_over(self._broadcast)

    _do_release = _do_stop

    def end_motions_of_stopped_robots(self) -> None:
        """End all programs and holds while robots are stopped, from whichever source: a release then moves no robot."""
        if self._feed.stopped or not self._commander.may_drive():
            self.programs.end_all()
            self._commander.dead_man.end_all_holds(read_clock_ms())

    def _do_end_drive(self, page: "PageSocket", request: Request) -> None:
        for robot in request["robots"]:
            self._commander.dead_man.release(page.number, robot)

    def _do_stop_some(self, page: "PageSocket", request: Request) -> None:
        self.programs.end_those_of(request["robots"])
        now_ms, dead_man = read_clock_ms(), self._commander.dead_man
        stopped = [robot for robot in request["robots"] if robot in self._feed.robots]
        driven = [robot for robot in stopped if dead_man.end_hold(robot, now_ms) not in (None, page.number)]
        if driven:
            text = "stopped: %s; another page drove, and needs a new press to drive again"
            page.tell("info", text % ", ".join(driven))

    def _do_dismiss(self, page: "PageSocket", request: Request) -> None:
        self._background.submit(self._feed.drivers.dismiss_gone)

    def _do_code(self, page: "PageSocket", request: Request) -> None:
        self._find_lesson().add(request["robots"])

    def _do_withdraw(self, page: "PageSocket", request: Request) -> None:
        self._find_lesson().withdraw(request["code"])

    def _find_lesson(self) -> Lesson:
        if self._lesson is None:
            raise RefusedError("this monitor has no codes: start it with classroom:=true")
        return self._lesson

    # ---------------------------------------------------------------- motion

    def _do_drive(self, page: "PageSocket", request: Request) -> None:
        robots, velocity = request["robots"], (float(request["linear"]), float(request["angular"]))
        over = [robot for robot in robots if self._commander.dead_man.is_over(robot, request["pressed_ms"])]
        if over:
            verb = "was" if len(over) == 1 else "were"
            raise RefusedError(f"{', '.join(over)} {verb} stopped: let go, and press again to drive")
        taken = [robot for robot in robots if not self._commander.drive(page.number, robot, *velocity)]
        if taken:
            verb = "is" if len(taken) == 1 else "are"
            text = f"{', '.join(taken)} {verb} driven from another page"
            if len(taken) == len(robots):
                raise RefusedError(text)
            page.tell("error", text)

    def _do_goal(self, page: "PageSocket", request: Request) -> None:
        if self._pending_goals >= GOALS_AT_ONCE:
            raise RefusedError("too many goals at once")
        (robot,), yaw_rad = request["robots"], request.get("yaw")
        frame, goal = self._feed.placement.to_goal(robot, Pose(request["x"], request["y"], yaw_rad or 0.0))
        self._pending_goals += 1
        sending = self._background.submit(self._commander.send_goal, robot, frame, goal, yaw_rad is not None)
        sending.add_done_callback(lambda sent: self._hand_over(self._tell_outcome, page, sent))

    def _tell_outcome(self, page: "PageSocket", sent: "Future[Tuple[str, str]]") -> None:
        self._pending_goals -= 1
        page.tell(*sent.result())

    # ---------------------------------------------------------------- programs

    def _do_start(self, page: "PageSocket", request: Request) -> None:
        program, robots, values = request["program"], request["robots"], request["values"]
        if program not in self.programs.paths:
            raise RefusedError(f"{program} is not installed")
        if self.programs.count >= PROGRAMS_MAX:
            raise RefusedError("%d programs run: end one first" % PROGRAMS_MAX)
        unknown = [robot for robot in robots if not self._feed.placement.knows(robot)]
        if OFFERS[program].has_frame and unknown:
            text = "%s needs the robots' places, but that of %s is unknown: start localize"
            raise RefusedError(text % (program, unknown[0]))
        child = ChildProcess(program, robots, place_robots(values, len(robots)))
        for robot in robots:
            # A stop at the end of the program then finds it open.
            self._commander.prepare(robot)
        ids = [self._feed.robots[robot].id for robot in robots]
        self.programs.start(child, make_arguments(program, ids, self._feed.placement.frame, values))

    def _do_end(self, page: "PageSocket", request: Request) -> None:
        self.programs.end(request["number"])

    def _stop_robots_of(self, child: ChildProcess) -> None:
        for robot in child.driven:
            self._commander.dead_man.stop(robot)

    def _do_record(self, page: "PageSocket", request: Request) -> None:
        recording = self.programs.find_recording()
        if recording is not None and not request["on"]:
            recording.end()
        elif recording is None and request["on"]:
            if "record" not in self.programs.paths:
                raise RefusedError("hero_recording is not installed")
            folder = Path(self._parameters.record_folder).expanduser() / time.strftime("%Y-%m-%d_%H-%M-%S")
            self.programs.start(ChildProcess("record", folder=folder), [f"--folder={folder}"])
