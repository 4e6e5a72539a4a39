"""A monitor without ROS: the real web server, and what its pages show told by a test."""

import asyncio
import json
import threading

import tornado.ioloop

from hero_monitor.control.offers import OFFERS, describe_offers, read_behaviors
from hero_monitor.control.requests import CLOCK_PERIOD_S, read_clock_ms
from hero_monitor.fleet_feed.page_state import encode
from hero_monitor.serving.access import Access
from hero_monitor.serving.client_limits import ClientLimits
from hero_monitor.serving.server import Actions, Server
from hero_swarm.describe import describe_behaviors
from hero_test.waiting import wait_for

OFFERS.update(read_behaviors(describe_behaviors()))


LONG_CAUSE = "No answer from " + ", ".join("hero_driver_%d" % number for number in range(30))


def make_robot(robot_id, **changes):
    """Return a row of the table; changes: of its fields."""
    row = {
        "name": "hero_%d" % robot_id,
        "id": robot_id,
        "address": "10.42.0.%d:4242" % (robot_id + 2),
        "state": "READY",
        "known": True,
        "stop": "",
        "firmware": "v3.8",
        "hardware": "v2.5",
        "config": "v2.3",
        "since": 75,
        "uptime": 80,
        "reconnects": 0,
        "bytes": 44051,
        "odom": 29.3,
        "speed": 0.05,
        "turn": -0.5,
        "distance": 1.25,
        "nearest": 0.0,
        "dropped": 0,
        "bad": 0,
        "clock": 0.0012,
        "error": "",
        "source": "odometry",
        "health": [0, ""],
    }
    return {**row, **changes}


def make_fleet(*robots, **changes):
    """Return the updates of a driver with these robots; changes: of the fleet's fields."""
    ready = sum(robot["state"] == "READY" for robot in robots)
    fleet = {"driver": True, "listening": "10.42.0.1:11411", "stopped": False, "robots": list(robots)}
    counts = "%d of %d robots ready" % (ready, len(robots))
    return {**fleet, "counts": counts, "frame": "world", "localized": False, **changes}


def make_program(number, **changes):
    """Return a program that runs on two robots; changes: of its fields."""
    program = {
        "number": number,
        "program": "random_walk",
        "title": "random walk",
        "robots": ["hero_0", "hero_1"],
        "places": [],
        "seconds": 65,
        "bytes": 0,
        "folder": "/tmp/recordings",
        "ending": False,
        "failure": "",
    }
    return {**program, **changes}


class ScriptedMonitor:
    """The server on a free port, until close()."""

    def __init__(self):
        self.requests = []
        offers = {"programs": describe_offers(list(OFFERS)), "record": True}
        hello = {"control": True, "node": "hero_monitor"}
        self.state = {"hello": hello, "offers": offers, "fleet": make_fleet(), "losses": [], "stop": None}
        self.is_silent = False
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        assert self._ready.wait(60.0)
        self.url = "http://127.0.0.1:%d/" % self.port

    def _run(self):
        asyncio.set_event_loop(asyncio.new_event_loop())
        self._loop = tornado.ioloop.IOLoop.current()
        actions = Actions(self._open, self._receive, lambda number: None, lambda: b"")
        self._server = Server(Access(None, []), ClientLimits(400), actions)
        self.port = self._server.listen("127.0.0.1", 0)
        clock = tornado.ioloop.PeriodicCallback(self._send_clock, 1e3 * CLOCK_PERIOD_S)
        clock.start()
        self._ready.set()
        self._loop.start()
        clock.stop()
        self._server.close()

    def _open(self, page):
        page.send(encode(self.state))

    def _receive(self, page, text):
        request = json.loads(text)
        self.requests.append(request)
        if self.is_silent:
            return
        if request["do"] in ("stop", "release"):
            stopped = request["do"] == "stop"
            status = {"level": "info", "text": "stopped, all wheels at rest", "is_final": True, "reads": 0}
            page.send(encode({"received": request["do"]}))
            self.show(fleet={**self.state["fleet"], "stopped": stopped}, stop=status if stopped else None)

    def _send_clock(self):
        if not self.is_silent:
            self._send({"clock_ms": read_clock_ms()})

    def _send(self, updates):
        for page in self._server.pages:
            page.send(encode(updates))

    def show(self, **updates):
        """Show these updates on all pages."""
        self.state.update(updates)
        self._loop.add_callback(self._send, updates)

    def tell(self, **updates):
        """Send what is said once, such as a notice."""
        self._loop.add_callback(self._send, updates)

    def requested(self, kind):
        """Return the requests of a kind."""
        return [request for request in self.requests if request["do"] == kind]

    def wait_for_request(self, kind):
        wait_for(lambda: self.requested(kind), "the request " + kind)

    def disconnect(self):
        """Close the connections of all pages."""
        self._loop.add_callback(lambda: [page.close() for page in list(self._server.pages)])

    def close(self):
        self._loop.add_callback(self._loop.stop)
        self._thread.join()
