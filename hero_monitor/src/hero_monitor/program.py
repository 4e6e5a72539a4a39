"""Node hero_monitor: the fleet on a web page.

    roslaunch hero_bringup monitor.launch

Everything runs on tornado's thread, except what may block (background).
"""

import asyncio
import platform
from typing import TYPE_CHECKING, Any, Dict, Union

import rospy

from hero_client.values.geometry import Pose
from hero_node.errors import ProgramError
from hero_node.file_limit import raise_file_limit
from hero_node.ros.program import Program, run

from .background import Background
from .control.commander import STOP_PERIOD_S, Commander
from .control.dead_man import DriveCommand
from .control.freshness import CLOCK_PERIOD_S, explain_refused_release, is_fresh, read_clock_ms
from .control.requests import RequestError, read_request
from .fleet_feed.feed import FleetFeed
from .fleet_feed.page_state import encode
from .parameters import Parameters, load_parameters
from .serving.access import Access
from .serving.connection_limits import CONNECTIONS_MAX, ConnectionLimits

if TYPE_CHECKING:
    from .serving.server import PageSocket

LINGER_S = 10.0
"""How long subscriptions outlive the last page, which may only reload."""

END_CHECK_PERIOD_S = 0.2

GOALS_AT_ONCE = 20


class Monitor:
    """Pages, the fleet that they show, and what they may do with it."""

    def __init__(self, parameters: Parameters, program: Program) -> None:
        # Here, so that a machine without tornado gets a line that says what to do.
        import tornado.ioloop

        from .serving.server import Actions, Server

        self._parameters = parameters
        self._program = program
        self._background = Background()
        self._feed = FleetFeed(parameters.map_frame, self._background)
        self._commander = Commander(self._feed.drivers, self._background)
        self._loop = tornado.ioloop.IOLoop.current()
        actions = Actions(self._open_page, self._receive, self._close_page, lambda: self._feed.picture.jpeg)
        # The other half of the files is for ROS: some per robot.
        limits = ConnectionLimits(min(CONNECTIONS_MAX, raise_file_limit() // 2))
        self._server = Server(Access(parameters.token, parameters.host_names), limits, actions)
        self._tick = tornado.ioloop.PeriodicCallback(self._update_pages, 1000.0 / parameters.rate_hz)
        self._stops = tornado.ioloop.PeriodicCallback(self._step, 1000.0 * STOP_PERIOD_S)
        self._clock = tornado.ioloop.PeriodicCallback(self._send_clock, 1000.0 * CLOCK_PERIOD_S)
        self._end_check = tornado.ioloop.PeriodicCallback(self._check_end, 1000.0 * END_CHECK_PERIOD_S)
        self._leaving: Any = None
        self._pending_goals = 0

    def run(self) -> None:
        """Serve pages until the program ends. Raises: ProgramError."""
        wanted = self._parameters
        try:
            port = self._server.listen(wanted.host, wanted.port)
        except (OSError, ValueError) as error:
            raise ProgramError(
                "cannot listen on %s port %d: %s; choose others with host:=ADDRESS port:=PORT"
                % (wanted.host, wanted.port, getattr(error, "strerror", None) or error)
            ) from None
        host = "[%s]" % wanted.host if ":" in wanted.host else wanted.host
        if wanted.host in ("0.0.0.0", "::"):
            host = platform.node()
        hint = "" if wanted.control else " (view only; control:=true allows driving)"
        rospy.loginfo("fleet monitor: http://%s:%d%s", host, port, hint)
        self._end_check.start()
        try:
            self._loop.start()
        finally:
            self._commander.close()
            self._server.close()
            self._background.close()

    def _check_end(self) -> None:
        if not self._program.running:
            self._loop.stop()

    # ---------------------------------------------------------------- pages come and go

    def _open_page(self, page: "PageSocket") -> None:
        if self._leaving is not None:
            self._loop.remove_timeout(self._leaving)
            self._leaving = None
        page.send(encode({"hello": {"control": self._parameters.control}}))
        if not self._tick.is_running():
            for repeated in (self._tick, self._stops, self._clock):
                repeated.start()

    def _close_page(self, page: "PageSocket") -> None:
        self._commander.drop_page(page.number)
        if not self._server.pages and self._leaving is None:
            self._leaving = self._loop.call_later(LINGER_S, self._leave)

    def _leave(self) -> None:
        """The last page has been gone for LINGER_S."""
        self._leaving = None
        for repeated in (self._tick, self._stops, self._clock):
            repeated.stop()
        self._feed.update_subscriptions(has_pages=False, ground_truth=False, picture=False)

    def _update_pages(self) -> None:
        pages = self._server.served_pages()
        ground_truth, picture = (any(getattr(page, name) for page in pages) for name in ("ground_truth", "picture"))
        self._feed.update_subscriptions(True, ground_truth, picture)
        self._feed.read()
        self._broadcast_updates()

    def _step(self) -> None:
        """Do what cannot wait for the next update of the pages."""
        self._commander.step()
        if self._feed.read_stop():
            self._broadcast_updates()

    def _send_clock(self) -> None:
        """Tell each page the time, which tells it that the monitor runs, and whether it is among those served."""
        served = set(self._server.served_pages())
        for page in self._server.pages:
            if page.ready:
                page.send(encode({"clock_ms": read_clock_ms(), "served": page in served}))

    def _broadcast_updates(self) -> None:
        """Send the pages what is new to them; a page that is still receiving the last update gets it later."""
        state, served = self._feed.page_state, set(self._server.served_pages())
        for page in self._server.pages:
            page.send_waiting()
            if page.ready:
                updates = (state.take_updates if page in served else state.take_stop)(page.seen)
                if updates is not None:
                    page.send(updates)

    # ---------------------------------------------------------------- requests of pages

    def _receive(self, page: "PageSocket", text: Union[str, bytes]) -> None:
        try:
            request = read_request(text)
        except RequestError as error:
            page.tell("error", "invalid request (%s): reload the page" % error)
            return
        kind, robot = request["do"], request.get("robot")
        if kind == "show":
            page.ground_truth, page.picture = request["ground_truth"], request["picture"]
            page.visible = request["visible"]
        elif kind == "stop":
            self._request_stop(page, stop=True)
        elif kind == "release":
            refusal = explain_refused_release(request, read_clock_ms(), self._commander.stopped_ms)
            if refusal:
                page.tell("error", refusal)
            else:
                self._request_stop(page, stop=False)
        elif kind == "end_drive":
            self._commander.end_drive(page.number, "/" + robot)
        elif not is_fresh(request, read_clock_ms()):
            # A button that is still held sends the next one at once.
            if kind != "drive":
                page.tell("error", "the request was delayed: nothing was done")
        elif not self._parameters.control:
            page.tell("error", "this monitor is view only: start it with control:=true to drive robots")
        elif robot not in self._feed.robots:
            page.tell("error", "%s is not connected" % robot)
        elif self._feed.stopped or not self._commander.may_drive():
            page.tell("error", "all robots are stopped: release them first")
        elif kind == "drive":
            velocity = DriveCommand("/" + robot, float(request["linear"]), float(request["angular"]))
            if not self._commander.drive(page.number, velocity):
                page.tell("error", "%s is driven from another page" % robot)
        elif self._pending_goals >= GOALS_AT_ONCE:
            page.tell("error", "too many goals at once")
        else:
            self._loop.add_callback(self._send_goal, page, request)

    def _request_stop(self, page: "PageSocket", stop: bool) -> None:
        self._commander.request_stop(stop)
        self._feed.read_stop()
        verb = "stop" if stop else "release"
        page.acknowledge(verb)
        # After the acknowledgement has left.
        self._loop.add_callback(self._broadcast_updates)
        self._background.warn("a page requests to %s all robots" % verb)

    async def _send_goal(self, page: "PageSocket", request: Dict[str, Any]) -> None:
        """Send a goal in the background, and tell the page the outcome."""
        robot, yaw_rad = request["robot"], request.get("yaw")
        frame, goal = self._feed.placement.to_goal(robot, Pose(request["x"], request["y"], yaw_rad or 0.0))
        self._pending_goals += 1
        try:
            sending = self._background.submit(self._commander.send_goal, "/" + robot, frame, goal, yaw_rad is not None)
            page.tell(*await asyncio.wrap_future(sending))
        finally:
            self._pending_goals -= 1


def _main() -> None:
    with Program("hero_monitor") as program:
        parameters = load_parameters()
        try:
            monitor = Monitor(parameters, program)
        except ImportError as error:
            raise ProgramError(
                "needs the Python package %s: apt-get install python3-tornado, or conda install tornado"
                % (error.name or "tornado")
            ) from None
        monitor.run()


def main() -> None:
    """Run the node."""
    run(_main)
