"""Requests to stop all robots, with a fleet of the test's own: what is answered holds, and is on the disk."""

from types import SimpleNamespace
from unittest import mock

import pytest
from std_srvs.srv import SetBoolRequest

from hero_driver.commands.stop_progress import StopState
from hero_driver.ros.log_relay import LogRelay
from hero_driver.stops import interface
from hero_driver.stops.store import StopStore
from hero_driver.transport.event_loop import EventLoop


class Fleet:
    stopped = False

    def set_stopped(self, stopped):
        self.stopped = stopped

    def list_stops(self):
        return []


@pytest.fixture(name="stops")
def make_stops(monkeypatch):
    monkeypatch.setattr(interface.rospy, "resolve_name", lambda name: name)
    monkeypatch.setattr(interface.rospy, "Publisher", mock.Mock())
    loop = mock.create_autospec(EventLoop, instance=True)
    loop.ask.side_effect = lambda ask, wait_s: ask(loop.answer) or loop.answer.call_args[0][0]
    loop.answer = mock.Mock()
    store = mock.create_autospec(StopStore, instance=True, path="/kept")
    stops = interface.StopInterface(loop, Fleet(), store, mock.create_autospec(LogRelay, instance=True))
    yield SimpleNamespace(interface=stops, store=store, loop=loop)
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


def test_a_stop_is_answered_with_the_states_of_robots(stops):
    assert serve(stops, True).message == "no robot is connected"
    stops.interface._fleet.list_stops = lambda: [StopState.MOVING, None, StopState.AT_REST, StopState.AT_REST]
    assert serve(stops, True).message == "1 MOVING, 1 AWAY, 2 AT_REST"
