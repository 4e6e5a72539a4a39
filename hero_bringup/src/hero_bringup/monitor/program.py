"""Node hero_monitor: the fleet on a web page.

    roslaunch hero_bringup monitor.launch

Parameters: the README of this package. Everything runs on one thread, tornado's, but for what may have to wait for
ROS: see feed and commander.
"""

import functools
import os
import re
import socket
import stat
from typing import TYPE_CHECKING, Any, List, NamedTuple, Optional, Union

import rospy

from hero_examples.program import Program, ProgramError, check_flag, check_number, read_parameters, run
from hero_examples.robot import MAX_LINEAR_M_S, MAX_TURN_RAD_S

from ..fleet_state import Pose
from . import requests
from .access import TOKEN_LENGTH_MIN, Access, is_loopback
from .commander import STOP_PERIOD_S, Commander
from .dead_man import Velocity
from .feed import FleetFeed
from .sections import encode

if TYPE_CHECKING:
    from .server import LivePage

LINGER_S = 10.0
"""Subscriptions stay so long after the last page is gone: it may be a reload."""

LOOK_PERIOD_S = 0.2
"""How often the loop looks whether the program is to end."""

TOKEN_REMEDY = (
    "write one into a file that only you can read, and name it with token_file:=FILE: "
    "(umask 077; python3 -c 'import secrets; print(secrets.token_urlsafe())' > FILE)"
)


class Parameters(NamedTuple):
    """The checked parameters of the node."""

    host: str
    port: int
    token: Optional[str]
    host_names: List[str]
    control: bool
    rate_hz: float
    map_frame: str


def read_token(host: str, file: str) -> Optional[str]:
    """Return the token in a file, None where none is needed. Raises: ProgramError."""
    if not file:
        if is_loopback(host):
            return None
        raise ProgramError(
            "~host is %s, which other machines can reach: that needs a token; %s" % (host, TOKEN_REMEDY)
        )
    path = os.path.expanduser(file)
    try:
        with open(path, encoding="utf-8") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            token = opened.read(1000).strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ProgramError("~token_file %s cannot be read: %s; %s" % (path, error, TOKEN_REMEDY)) from None
    if stat.S_ISREG(mode) and mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ProgramError("~token_file %s can be read by others: chmod 600 %s" % (path, path))
    if len(token) < TOKEN_LENGTH_MIN:
        raise ProgramError(
            "~token_file %s holds less than %d characters: %s" % (path, TOKEN_LENGTH_MIN, TOKEN_REMEDY)
        )
    return token


def load_parameters() -> Parameters:
    """Return the node's private parameters. Raises: ProgramError."""
    given = read_parameters(
        {
            "host": "127.0.0.1",
            "port": 8088,
            "token_file": "",
            "host_names": "",
            "control": False,
            "rate_hz": 10.0,
            "map_frame": "world",
        }
    )
    host, port = str(given["host"]), check_number("port", given["port"], 0, 65535)
    if port != int(port) or not host:
        raise ProgramError("~host %r, ~port %r: needs an address and a whole number" % (host, port))
    names = re.split(r"[\s,]+", str(given["host_names"]).strip())
    own_name = socket.gethostname()
    return Parameters(
        host,
        int(port),
        read_token(host, str(given["token_file"])),
        [name for name in [*names, own_name, own_name.partition(".")[0] + ".local", host] if name],
        check_flag("control", given["control"]),
        check_number("rate_hz", given["rate_hz"], 1.0, 30.0, "Hz"),
        str(given["map_frame"]).lstrip("/"),
    )


class Monitor:
    """Pages, the fleet that they show, and what they may do with it."""

    def __init__(self, parameters: Parameters, program: Program) -> None:
        # Here, so that a machine without tornado gets a line that says what to do.
        import tornado.ioloop

        from .server import Actions, Server

        self._parameters = parameters
        self._program = program
        self._feed = FleetFeed(parameters.map_frame)
        self._commander = Commander(self._feed.drivers)
        self._loop = tornado.ioloop.IOLoop.current()
        actions = Actions(self._open_page, self._receive, self._close_page)
        self._server = Server(Access(parameters.token, parameters.host_names), actions)
        self._tick = tornado.ioloop.PeriodicCallback(self._send_news, 1000.0 / parameters.rate_hz)
        self._stops = tornado.ioloop.PeriodicCallback(self._commander.step, 1000.0 * STOP_PERIOD_S)
        self._look = tornado.ioloop.PeriodicCallback(self._look_for_end, 1000.0 * LOOK_PERIOD_S)
        self._leaving: Any = None

    def run(self) -> None:
        """Serve pages until the program is to end. Raises: ProgramError."""
        wanted = self._parameters
        try:
            port = self._server.listen(wanted.host, wanted.port)
        except OSError as error:
            raise ProgramError(
                "cannot listen on %s port %d: %s; choose another with port:=PORT"
                % (wanted.host, wanted.port, os.strerror(error.errno) if error.errno else error)
            ) from None
        host = "[%s]" % wanted.host if ":" in wanted.host else wanted.host
        if wanted.host in ("0.0.0.0", "::"):
            host = socket.gethostname()
        rospy.loginfo(
            "fleet monitor: http://%s:%d%s", host, port, "" if wanted.control else " (looking only; control:=true)"
        )
        self._look.start()
        try:
            self._loop.start()
        finally:
            self._commander.close()
            self._server.close()
            self._feed.close()

    def _look_for_end(self) -> None:
        if not self._program.running:
            self._loop.stop()

    # ---------------------------------------------------------------- pages come and go

    def _open_page(self, page: "LivePage") -> None:
        if self._leaving is not None:
            self._loop.remove_timeout(self._leaving)
            self._leaving = None
        limits = {"linear": MAX_LINEAR_M_S, "turn": MAX_TURN_RAD_S}
        page.send(encode({"hello": {"control": self._parameters.control, "limits": limits}}))
        if not self._tick.is_running():
            self._tick.start()
            self._stops.start()

    def _close_page(self, page: "LivePage") -> None:
        self._commander.drop_page(page.number)
        if not self._server.pages and self._leaving is None:
            self._leaving = self._loop.call_later(LINGER_S, self._leave)

    def _leave(self) -> None:
        """Nobody looks any more."""
        self._leaving = None
        self._tick.stop()
        self._stops.stop()
        self._feed.want(looking=False, truth=False)

    def _send_news(self) -> None:
        pages = self._server.pages
        self._feed.want(True, any(page.truth for page in pages))
        self._feed.read()
        for page in pages:
            page.send_notices()
            if page.ready:
                news = self._feed.sections.take_news(page.seen)
                if news is not None:
                    page.send(news)

    # ---------------------------------------------------------------- what pages want

    def _receive(self, page: "LivePage", text: Union[str, bytes]) -> None:
        try:
            request = requests.read_request(text, MAX_LINEAR_M_S, MAX_TURN_RAD_S)
        except requests.RequestError as error:
            page.tell("error", "the page asked for something that is not understood (%s); reload it" % error)
            return
        if isinstance(request, requests.Look):
            page.truth = request.truth
        elif isinstance(request, requests.Stop):
            rospy.logwarn("all robots are %s from a page", "stopped" if request.stop else "let go")
            self._commander.stop_all(request.stop, functools.partial(self._tell_later, page))
        elif isinstance(request, requests.Release):
            self._commander.release(page.number, "/" + request.robot)
        elif not self._parameters.control:
            page.tell("error", "this monitor only looks: start it with control:=true to drive robots")
        elif request.robot not in self._feed.robots:
            page.tell("error", "%s is not there" % request.robot)
        elif isinstance(request, requests.Drive):
            velocity = Velocity("/" + request.robot, request.linear_m_s, request.turn_rad_s)
            if not self._commander.drive(page.number, velocity):
                page.tell("error", "%s is driven from another page" % request.robot)
        else:
            goal = Pose(request.x_m, request.y_m, request.yaw_rad or 0.0)
            self._commander.send_goal(
                "/" + request.robot,
                self._feed.placement.to_odometry(request.robot, goal),
                request.yaw_rad is not None,
                functools.partial(self._tell_later, page),
            )

    def _tell_later(self, page: "LivePage", level: str, text: str) -> None:
        """Tell a page something from another thread."""
        self._loop.add_callback(page.tell, level, text)


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
