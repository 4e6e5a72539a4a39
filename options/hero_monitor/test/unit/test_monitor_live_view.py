"""Stepped robots in Foxglove: a client reads them from a view, without ROS."""

import asyncio
import json
import threading
import time
from types import SimpleNamespace

import pytest
import tornado.httpclient
import tornado.websocket

from hero_monitor.live_view import LiveView
from hero_node import ProgramError
from hero_sim.stepped import StepSwarm

SUBPROTOCOL = "foxglove.sdk.v1"


async def read(port, topics):
    """Subscribe to topics, and return the offer and the first message of each."""
    url = "ws://127.0.0.1:%d/foxglove" % port
    socket = await tornado.websocket.websocket_connect(url, subprotocols=[SUBPROTOCOL])
    offers, first = {}, {}
    while len(first) < len(topics):
        message = await socket.read_message()
        if isinstance(message, bytes):
            first.setdefault(int.from_bytes(message[1:5], "little"), message[13:])
        elif json.loads(message)["op"] == "advertise":
            offers = {each["topic"]: each for each in json.loads(message)["channels"]}
            wanted = [{"id": number, "channelId": offers[topic]["id"]} for number, topic in enumerate(topics)]
            await socket.write_message(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    socket.close()
    return offers, [first[number] for number in range(len(topics))]


@pytest.fixture()
def swarm():
    """Robots that a thread steps until the test ends."""
    with StepSwarm(2, arena="maze") as swarm:
        yield swarm


@pytest.fixture()
def stepped(swarm):
    """A view of robots that are stepped without a pause."""
    view = LiveView(swarm.rows, range(2), port=0, speed=1e6, origins=["https://viewer.example"])
    is_ending = threading.Event()

    def step():
        while not is_ending.is_set():
            swarm.sleep(0.1)
            time.sleep(0.001)  # lets the view's thread run

    thread = threading.Thread(target=step)
    thread.start()
    yield view
    is_ending.set()
    thread.join()
    view.close()
    view.close()


def test_a_client_gets_the_robots_and_what_was_published_before_it_came(stepped):
    topics = ["/tf_static", "/hero_sim/arena", "/hero_1/odom"]
    for _ in range(2):  # and so does a later one
        offers, messages = asyncio.run(read(stepped.port, topics))
        assert offers["/hero_1/odom"]["schemaName"] == "nav_msgs/Odometry"
        assert b"hero_1/odom" in messages[0] and b"walls" in messages[1] and b"hero_1/base_link" in messages[2]


def test_pages_of_other_servers_are_refused_but_those_that_were_named(stepped):
    async def connect(origin):
        url = "ws://127.0.0.1:%d/foxglove" % stepped.port
        request = tornado.httpclient.HTTPRequest(url, headers={"Origin": origin})
        (await tornado.websocket.websocket_connect(request, subprotocols=[SUBPROTOCOL])).close()

    asyncio.run(connect("https://viewer.example"))
    with pytest.raises(tornado.httpclient.HTTPClientError, match="403"):
        asyncio.run(connect("https://elsewhere.example"))


def test_time_is_slowed_to_real_time_until_the_view_is_closed(swarm, monkeypatch):
    slept = []
    clock = SimpleNamespace(monotonic=lambda: sum(slept), sleep=slept.append)
    monkeypatch.setattr("hero_monitor.live_view.time", clock)
    swarm.sleep(1.0)  # before somebody looks
    with LiveView(swarm.rows, range(2), port=0, speed=2.0):
        swarm.sleep(3.0)
    assert sum(slept) == pytest.approx(1.5, abs=0.05)
    before = len(slept)
    swarm.sleep(1.0)
    assert len(slept) == before


def test_a_taken_port_is_told(swarm):
    with LiveView(swarm.rows, range(2), port=0) as view, pytest.raises(ProgramError, match=str(view.port)):
        LiveView(swarm.rows, range(2), port=view.port)
    assert swarm.rows.on_cycle == []
