"""Carries out the requests of pages, or tells them why not; on the thread of the pages."""

import time
from concurrent.futures import Future
from pathlib import Path
from typing import TYPE_CHECKING, Any, Callable, Dict, Union

import rospy

from hero_client.apps.formations import FormationError
from hero_node.geometry import Pose

from .background import Background
from .control.client_commands import read_command
from .control.commander import Commander, Notice
from .control.dead_man import DriveCommand
from .control.freshness import explain_refused_release, is_fresh, read_clock_ms
from .control.offers import OFFERS, check_values, make_arguments, place_robots
from .control.programs import PROGRAMS_MAX, Child, Programs
from .control.requests import RequestError, read_request
from .fleet_feed.feed import FleetFeed
from .parameters import Parameters

if TYPE_CHECKING:
    from .serving.server import PageSocket

Request = Dict[str, Any]

GOALS_AT_ONCE = 100

MOVING = ("drive", "goal", "start")
"""Requests that make robots move: fresh, with control:=true, of robots that are connected and not stopped."""


class PageRequests:
    """Requests of pages for robots, programs and the recording."""

    def __init__(
        self,
        parameters: Parameters,
        feed: FleetFeed,
        commander: Commander,
        background: Background,
        hand_over: Callable[..., Any],
        broadcast: Callable[[], None],
    ) -> None:
        """hand_over: calls a function later, on this thread. broadcast: sends to pages what is new to them."""
        self._parameters, self._feed, self._commander = parameters, feed, commander
        self._background, self._hand_over, self._broadcast = background, hand_over, broadcast
        self.programs = Programs(rospy.get_name(), hand_over, self._stop_robots_of)
        self._pending_goals = 0
        self._carry_out: Dict[str, Callable[[PageSocket, Request], str]] = {
            "show": self._show,
            "stop": self._stop,
            "release": self._release,
            "end_drive": self._end_drive,
            "stop_some": self._stop_some,
            "end": self._end,
            "drive": self._drive,
            "goal": self._goal,
            "start": self._start,
            "record": self._record,
        }

    def receive(self, page: "PageSocket", text: Union[str, bytes]) -> None:
        """Carry out a request, or tell the page why not."""
        try:
            request = read_request(text)
            if request["do"] == "start":
                check_values(request["program"], request["values"])
        except RequestError as error:
            page.tell("error", "invalid request (%s): reload the page" % error)
            return
        is_delayed = not is_fresh(request, read_clock_ms()) and request["do"] != "release"
        if is_delayed and request["do"] == "drive":
            return  # a button that is still held sends the next one at once
        refusal = "the request was delayed: nothing was done" if is_delayed else self._explain_refusal(request)
        refusal = refusal or self._carry_out[request["do"]](page, request)
        if refusal:
            page.tell("error", refusal)

    def publish(self, client: int, topic: str, message_type: str, content: bytes) -> str:
        """Carry out a message of a Foxglove client by the rules of the page; return why it is refused, empty if not."""
        command = read_command(topic, message_type, content)
        if command is None:
            return "%s: only /hero_N/cmd_vel (geometry_msgs/Twist) and stop_request (std_msgs/Bool) are taken" % topic
        if isinstance(command, bool):
            if not command:
                return "robots are released on the page only"
            self._commander.request_stop(True)
            self.end_programs_of_stopped_robots()
            self._background.warn("a Foxglove client requests to stop all robots")
            return ""
        robot = command.namespace.strip("/")
        if not (command.linear_m_s or command.angular_rad_s):
            self._commander.end_drive(client, command.namespace)
            return ""
        refusal = self._explain_refusal({"do": "drive", "robots": [robot]})
        if not refusal and not self._commander.drive(client, command):
            refusal = "%s is driven from another page" % robot
        return refusal

    def _explain_refusal(self, request: Request) -> str:
        """Return why a request is refused; empty if it is not."""
        if request["do"] not in (*MOVING, "record"):
            return ""
        if not self._parameters.control:
            return "this monitor is view only: start it with control:=true to drive robots"
        if request["do"] == "record":
            return ""
        missing = [robot for robot in request["robots"] if robot not in self._feed.robots]
        if missing:
            return "%s %s not connected" % (", ".join(missing), "is" if len(missing) == 1 else "are")
        if self._feed.stopped or not self._commander.may_drive():
            return "all robots are stopped: release them first"
        return "" if request["do"] == "goal" else self.programs.find_driver(request["robots"])

    # ---------------------------------------------------------------- view and stops

    def _show(self, page: "PageSocket", request: Request) -> str:
        page.ground_truth, page.picture = request["ground_truth"], request["picture"]
        page.visible = request["visible"]
        return ""

    def _stop(self, page: "PageSocket", request: Request) -> str:
        self._request_stop(page, stop=True)
        return ""

    def _release(self, page: "PageSocket", request: Request) -> str:
        refusal = explain_refused_release(request, read_clock_ms(), self._commander.stopped_ms)
        if not refusal:
            self._request_stop(page, stop=False)
        return refusal

    def _request_stop(self, page: "PageSocket", stop: bool) -> None:
        self._commander.request_stop(stop)
        self.end_programs_of_stopped_robots()
        self._feed.read_stop()
        verb = "stop" if stop else "release"
        page.acknowledge(verb)
        # After the acknowledgement has left.
        self._hand_over(self._broadcast)
        self._background.warn("a page requests to %s all robots" % verb)

    def end_programs_of_stopped_robots(self) -> None:
        """End all programs while all robots are stopped, from whichever source: a release then moves no robot."""
        if self._feed.stopped or not self._commander.may_drive():
            self.programs.end_all()

    def _end_drive(self, page: "PageSocket", request: Request) -> str:
        for robot in request["robots"]:
            self._commander.end_drive(page.number, "/" + robot)
        return ""

    def _stop_some(self, page: "PageSocket", request: Request) -> str:
        self.programs.end_those_of(request["robots"])
        for robot in request["robots"]:
            if robot in self._feed.robots:
                self._commander.stop_robot("/" + robot)
        return ""

    # ---------------------------------------------------------------- motion

    def _drive(self, page: "PageSocket", request: Request) -> str:
        taken = []
        for robot in request["robots"]:
            velocity = DriveCommand("/" + robot, float(request["linear"]), float(request["angular"]))
            if not self._commander.drive(page.number, velocity):
                taken.append(robot)
        verb = "is" if len(taken) == 1 else "are"
        return "%s %s driven from another page" % (", ".join(taken), verb) if taken else ""

    def _goal(self, page: "PageSocket", request: Request) -> str:
        if self._pending_goals >= GOALS_AT_ONCE:
            return "too many goals at once"
        (robot,), yaw_rad = request["robots"], request.get("yaw")
        frame, goal = self._feed.placement.to_goal(robot, Pose(request["x"], request["y"], yaw_rad or 0.0))
        self._pending_goals += 1
        sending = self._background.submit(self._commander.send_goal, "/" + robot, frame, goal, yaw_rad is not None)
        sending.add_done_callback(lambda sent: self._hand_over(self._tell_outcome, page, sent))
        return ""

    def _tell_outcome(self, page: "PageSocket", sent: "Future[Notice]") -> None:
        self._pending_goals -= 1
        page.tell(*sent.result())

    # ---------------------------------------------------------------- programs

    def _start(self, page: "PageSocket", request: Request) -> str:
        program, robots, values = request["program"], request["robots"], request["values"]
        if program not in self.programs.paths:
            return "%s is not installed" % program
        if self.programs.count >= PROGRAMS_MAX:
            return "%d programs run: end one first" % PROGRAMS_MAX
        unknown = [robot for robot in robots if not self._feed.placement.knows(robot)]
        if OFFERS[program].has_frame and unknown:
            return "%s needs the robots' places, but that of %s is unknown: start localize" % (program, unknown[0])
        try:
            places = place_robots(values, len(robots))
        except FormationError as error:
            return str(error)
        ids = [self._feed.robots[robot].id for robot in robots]
        for robot in robots:
            # A stop at the end of the program then finds it open.
            self._commander.prepare("/" + robot)
        arguments = make_arguments(program, ids, self._feed.placement.frame, values)
        self.programs.start(Child(program, robots, places), arguments)
        return ""

    def _end(self, page: "PageSocket", request: Request) -> str:
        self.programs.end(request["number"])
        return ""

    def _stop_robots_of(self, child: Child) -> None:
        for robot in child.driven:
            self._commander.stop_robot("/" + robot)

    def _record(self, page: "PageSocket", request: Request) -> str:
        recording = self.programs.find_recording()
        if recording is not None:
            if not request["on"]:
                recording.end()
            return ""
        if not request["on"]:
            return ""
        if "record" not in self.programs.paths:
            return "hero_recording is not installed"
        folder = Path(self._parameters.record_folder).expanduser() / time.strftime("%Y-%m-%d_%H-%M-%S")
        self.programs.start(Child("record", folder=folder), ["--folder=%s" % folder])
        return ""
