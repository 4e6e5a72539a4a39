"""Node hero_monitor: the fleet on a web page.

    roslaunch hero_bringup monitor.launch

Everything runs on tornado's thread, except what may block (background).
"""

from typing import TYPE_CHECKING, Any, Dict

import rospy

from hero_node import ProgramError, import_optional, raise_file_limit
from hero_node.ros import Program

from .background import Background
from .control.drive_requests import STOP_PERIOD_S, DriveRequests
from .control.offers import OFFERS, describe_offers
from .control.programs import find_behaviors, find_programs
from .control.requests import CLOCK_PERIOD_S, read_clock_ms
from .fleet_feed.feed import FleetFeed
from .fleet_feed.page_state import encode
from .page_requests import PageRequests
from .parameters import Parameters, list_host_names, load_parameters, read_token
from .serving.access import Access
from .serving.client_limits import CONNECTIONS_MAX, ClientLimits
from .serving.invitation import describe_invitation, make_link, make_login_link
from .serving.lesson import TEACHER, Lesson

if TYPE_CHECKING:
    from .serving.server import PageSocket

LINGER_S = 10.0
"""Time that subscriptions outlive the last page, which may only reload."""

END_CHECK_PERIOD_S = 0.2

LESSON = "lesson"
"""Part of the page state."""


class Monitor:
    """Pages, the fleet that they show, and what they may do with it."""

    def __init__(self, parameters: Parameters, program: Program) -> None:
        # Here, so that a machine without tornado gets a line that says what to do: see main().
        import tornado.ioloop

        from .serving.server import Actions, MonotonicLoop, Server

        self._parameters = parameters
        self._program = program
        self._background = Background()
        self._feed = FleetFeed(parameters.map_frame, self._background)
        self._commander = DriveRequests(self._feed.drivers, self._background)
        self._lesson = Lesson() if parameters.classroom else None
        self._loop = MonotonicLoop()
        self._requests = PageRequests(
            parameters,
            self._feed,
            self._commander,
            self._background,
            self._loop.add_callback,
            self._broadcast_updates,
            self._lesson,
        )
        self._programs = self._requests.programs
        declared = [[topic.name, topic.unit] for topic in self._feed.lab_file.topics]
        hello = {"control": parameters.control, "topics": declared, "node": rospy.get_name().strip("/")}
        self._feed.page_state.put("hello", hello)
        actions = Actions(self._enter, self._requests.receive, self._leave, lambda: self._feed.picture.jpeg)
        # The other half of the files is for ROS: some per robot.
        limits = ClientLimits(min(CONNECTIONS_MAX, raise_file_limit() // 2))
        token = read_token(parameters.host, parameters.token_file)
        access = Access(token, list_host_names(parameters), self._lesson)
        self._server = Server(access, limits, actions)
        self._repeated = [
            tornado.ioloop.PeriodicCallback(call, 1000.0 * period_s)
            for call, period_s in (
                (self._update_pages, 1.0 / parameters.rate_hz),
                (self._step, STOP_PERIOD_S),
                (self._send_clock, CLOCK_PERIOD_S),
            )
        ]
        self._end_check = tornado.ioloop.PeriodicCallback(self._check_end, 1000.0 * END_CHECK_PERIOD_S)
        self._resting: Any = None

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
        if self._lesson is not None:
            place = wanted.host, port, self._lesson.class_code
            self._invitation = describe_invitation(*place)
            rospy.loginfo("class code %s, or %s", self._lesson.class_code, make_login_link(*place))
        hint = "" if wanted.control else " (view only; control:=true allows driving)"
        rospy.loginfo("fleet monitor: %s%s", make_link(wanted.host, port), hint)
        self._end_check.start()
        if wanted.control:
            finding = self._background.submit(self._find_programs)
            finding.add_done_callback(lambda found: self._loop.add_callback(self._offer, found.result()))
        try:
            self._loop.start()
        finally:
            self._programs.close()
            self._commander.close()
            self._server.close()
            self._background.shutdown(wait=False)

    def _find_programs(self) -> Dict[str, str]:
        OFFERS.update(find_behaviors(self._parameters.behavior_folder))
        return find_programs()

    def _offer(self, paths: Dict[str, str]) -> None:
        self._programs.paths = paths
        self._feed.page_state.put("offers", {"programs": describe_offers(list(paths)), "record": "record" in paths})

    def _check_end(self) -> None:
        self._programs.beat()
        if not self._program.running:
            self._loop.stop()

    # ---------------------------------------------------------------- pages come and go

    def _enter(self, page: "PageSocket") -> None:
        """A page is there: robots are watched, and stopped when it falls silent."""
        if self._resting is not None:
            self._loop.remove_timeout(self._resting)
            self._resting = None
        for repeated in self._repeated:
            if not repeated.is_running():
                repeated.start()

    def _leave(self, number: int) -> None:
        self._commander.dead_man.drop_page(number)
        if not self._server.pages and self._resting is None:
            self._resting = self._loop.call_later(LINGER_S, self._rest)

    def _rest(self) -> None:
        """The last page has been gone for LINGER_S: no one there can stop what pages have started."""
        self._resting = None
        if self._programs.end_all():
            self._resting = self._loop.call_later(END_CHECK_PERIOD_S, self._rest)
            return
        for repeated in self._repeated:
            repeated.stop()
        self._feed.update_subscriptions(has_pages=False, picture=False)

    def _update_pages(self) -> None:
        pages = self._server.pages
        self._feed.update_subscriptions(True, any(page.picture for page in pages))
        self._feed.read()
        self._feed.page_state.put("programs", self._programs.describe())
        if self._lesson is not None:
            users = sorted((page.user.name, page.user.role.title, sorted(page.user.role.robots)) for page in pages)
            drivers = self._lesson.list_drivers()
            self._feed.page_state.put(LESSON, {**self._invitation, "drivers": drivers, "users": users})
        self._broadcast_updates()

    def _step(self) -> None:
        """Do what cannot wait for the next update of the pages."""
        self._commander.step()
        self._requests.end_motions_of_stopped_robots()
        if self._feed.read_stop():
            self._broadcast_updates()

    def _send_clock(self) -> None:
        """Tell each page the time, which tells it that the monitor runs, and what its user may do."""
        for page in self._server.pages:
            if page.ready:
                message: Dict[str, Any] = {"clock_ms": read_clock_ms()}
                user = page.user
                if user != page.shown_user:
                    page.shown_user = user
                    message["user"] = {"name": user.name, "title": user.role.title, "robots": sorted(user.role.robots)}
                page.send(encode(message))

    def _broadcast_updates(self) -> None:
        """Send the pages what is new to them; a page that is still receiving the last update gets it later."""
        state = self._feed.page_state
        for page in self._server.pages:
            page.send_waiting()
            if page.ready:
                # Codes are for teachers.
                updates = state.take_updates(page.seen, "" if page.user.role == TEACHER else LESSON)
                if updates is not None:
                    page.send(updates)


def main() -> None:
    """Run the node."""
    with Program("hero_monitor") as program:
        parameters = load_parameters()
        import_optional("tornado", "python3-tornado")
        Monitor(parameters, program).run()
