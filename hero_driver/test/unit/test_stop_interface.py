"""Requests to stop all robots, with a fleet of the test's own: what is answered holds, and is on the disk."""

import threading
from types import SimpleNamespace
from unittest import mock

import pytest
import rospy
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, SetBoolRequest

from hero_driver.commands.stop_progress import StopState
from hero_driver.ros.log_relay import LogRelay
from hero_driver.stops import interface
from hero_driver.stops.store import StopStore
from hero_driver.transport.event_loop import EventLoop, NoAnswerError

NOW_S = 1.8e9


class Fleet:
    stopped = False

    def set_stopped(self, stopped):
        self.stopped = stopped

    def list_stops(self):
        return []


@pytest.fixture(name="stops")
def make_stops(monkeypatch):
    monkeypatch.setattr(interface.rospy, "resolve_name", lambda name: name)
    ros = {name: mock.create_autospec(getattr(rospy, name)) for name in ("Publisher", "Subscriber", "Service")}
    for name, value in ros.items():
        monkeypatch.setattr(interface.rospy, name, value)

    def list_publishers(topic, kind):
        assert not ros["Subscriber"].called, "publishers that it learns of are there before rospy connects to them"
        return frozenset({"earlier"})

    monkeypatch.setattr(interface, "list_publishers", list_publishers)
    connections = {}
    monkeypatch.setattr(interface, "find_connection", lambda topic, message: connections.get(id(message)))
    loop = mock.create_autospec(EventLoop, instance=True)
    loop.ask.side_effect = lambda ask, wait_s: ask(loop.answer) or loop.answer.call_args[0][0]
    loop.answer = mock.Mock()
    store = mock.create_autospec(StopStore, instance=True, path="/kept")
    stops = interface.StopInterface(loop, Fleet(), store, mock.create_autospec(LogRelay, instance=True))
    stops._log.lines = []
    stops._log.log.side_effect = lambda level, text: stops._log.lines.append(text)
    yield SimpleNamespace(interface=stops, store=store, loop=loop, connections=connections, **ros)
    stops.close()


def serve(stops, stopped):
    request = SetBoolRequest(stopped)
    request._connection_header = {"callerid": "/teleop"}
    return stops.interface._serve(request)


def test_the_answer_comes_once_what_was_asked_for_is_on_the_disk(stops):
    for stopped in (True, False):
        stops.store.write.reset_mock()
        assert serve(stops, stopped).success
        assert stops.interface._fleet.stopped is stopped
        assert {call[0] for call in stops.store.write.call_args_list} == {(stopped,)}


def test_a_stop_that_cannot_be_kept_is_answered_with_what_is_lost(stops):
    stops.store.write.side_effect = OSError(28, "No space left on device")
    answer = serve(stops, True)
    assert answer.success and stops.interface._fleet.stopped
    assert "will not survive a restart of the driver: /kept cannot be written (No space left" in answer.message


def test_a_fault_of_the_driver_is_not_told_as_one_of_the_disk(stops):
    stops.store.write.side_effect = TypeError("a fault")
    with pytest.raises(TypeError):
        stops.interface._keep()


def test_a_stop_is_answered_with_the_states_of_robots(stops):
    assert serve(stops, True).message == "no robot is connected"
    stops.interface._fleet.list_stops = lambda: [StopState.MOVING, None, StopState.AT_REST, StopState.AT_REST]
    assert serve(stops, True).message == "1 MOVING, 1 AWAY, 2 AT_REST"


def request(stops, stopped, connection=None, caller="/teleop"):
    """Let a program publish on ~stop_request, and the loop take that."""
    message = Bool(stopped)
    message._connection_header = {"callerid": caller}
    stops.connections[id(message)] = connection
    stops.loop.call_soon.reset_mock()
    stops.interface._take_request(message)
    for one in stops.loop.call_soon.call_args_list:
        one.args[0]()
    return stops.interface._fleet.stopped


def make_connection(is_latched, endpoint_id):
    return type("Connection", (), {"is_latched": is_latched, "endpoint_id": endpoint_id})()


def test_all_that_stops_robots_is_offered_at_the_start(stops):
    stops.interface.open(False, None)
    stops.Subscriber.assert_called_once_with(
        "~stop_request", Bool, stops.interface._take_request, queue_size=10, tcp_nodelay=True
    )
    stops.Service.assert_called_once_with("~stop", SetBool, stops.interface._serve)
    stops.Publisher.assert_called_once_with("~stopped", Bool, queue_size=1, latch=True)
    stops.Publisher.return_value.publish.assert_called_once_with(Bool(False))
    assert stops.interface._log.lines == [] and stops.interface.stopped_s is None


@pytest.mark.parametrize(
    ("since_s", "words", "ago_s"),
    [
        (None, "from the start (~start_stopped)", 0.0),
        (interface.UNKNOWN_TIME_S, "since an unknown time", None),
        (NOW_S - 60.0, "since ", 60.0),
        (NOW_S + 60.0, "since ", 0.0),
    ],
)
def test_robots_that_were_stopped_stay_so_and_the_log_says_since_when(stops, monkeypatch, since_s, words, ago_s):
    monkeypatch.setattr(interface.time, "time", lambda: NOW_S)
    monkeypatch.setattr(interface.time, "monotonic", lambda: 500.0)
    stops.interface.open(True, since_s)
    assert stops.interface._fleet.stopped
    stops.Publisher.return_value.publish.assert_called_once_with(Bool(True))
    (line,) = stops.interface._log.lines
    assert "all robots are stopped " + words in line and line.endswith("releases them: rosservice call ~stop false")
    assert stops.interface.stopped_s == (None if ago_s is None else 500.0 - ago_s)
    stops.interface.close()
    assert (True,) in {call[0] for call in stops.store.write.call_args_list}


def test_a_release_from_before_the_driver_was_there_is_refused_once(stops):
    stops.interface.open(True, None)
    latched, later = make_connection(True, "earlier"), make_connection(True, "later")
    assert request(stops, False, latched), "refused"
    assert "a release on ~stop_request was refused" in stops.interface._log.lines[-1]
    assert not request(stops, False, latched), "its second message is of now"
    assert request(stops, True, later) and not request(stops, False, later)
    assert request(stops, True, make_connection(True, "earlier")), "an old stop counts"
    assert not request(stops, False, later) and request(stops, True) and not request(stops, False)


def test_each_change_is_published_kept_and_told_with_who_made_it(stops):
    stops.interface.open(False, None)
    stops.Publisher.return_value.publish.reset_mock()
    order = []
    stops.store.write.side_effect = lambda stopped: order.append("kept")
    stops.Publisher.return_value.publish.side_effect = lambda message: order.append("published")
    for stopped in (False, True, True, False, False):
        request(stops, stopped)
    assert stops.interface._log.lines == ["stopping all robots, by /teleop", "robots may move, by /teleop"]
    assert (stops.interface.stopped_by, stops.interface.stopped_s) == ("", None)
    request(stops, True, caller="")
    assert stops.interface._log.lines[-1] == "stopping all robots, by ?" and stops.interface.stopped_s is not None
    stops.interface.close()
    published = [call[0][0].data for call in stops.Publisher.return_value.publish.call_args_list]
    assert published == [True, False, True] and order[-6:] == ["kept", "published"] * 3


def test_a_disk_that_hangs_is_told_of_in_the_answer(stops, monkeypatch):
    monkeypatch.setattr(interface, "KEEP_WAIT_S", 0.01)
    released = threading.Event()
    stops.store.write.side_effect = lambda stopped: released.wait(60.0)
    answer = serve(stops, True)
    released.set()
    assert answer.success and "not yet written to /kept, which hangs" in answer.message


@pytest.mark.parametrize(("stopped", "words"), [(True, "NOT STOPPED: the driver hangs"), (False, "the driver hangs")])
def test_a_driver_that_hangs_answers_that_it_did_not_stop(stops, stopped, words):
    stops.loop.ask.side_effect = NoAnswerError("hangs")
    answer = serve(stops, stopped)
    assert not answer.success and answer.message == words and not stops.store.write.called
