"""How long the driver waits before it dials a robot again; the sockets themselves are tested by test_driver_dial.py."""

import threading
import types

import pytest

from hero_driver.transport import dialer
from hero_driver.transport.dialer import start_dialer

ADDRESS = ("127.0.0.1", 11411)
CALLS = 8
BACKED_OFF_S = [0.5, 1.0, 2.0, 4.0, 8.0, 10.0, 10.0, 10.0]


class Ended:
    """An event that is set after some waits, which take no time."""

    def __init__(self):
        self.waits_s = []
        self.is_over = threading.Event()

    def is_set(self):
        return self.is_over.is_set()

    def wait(self, duration_s):
        self.waits_s.append(duration_s)
        if len(self.waits_s) == CALLS:
            self.is_over.set()


@pytest.mark.parametrize(
    "lasts_s, expected_s",
    [(0.0, BACKED_OFF_S), (2.9, BACKED_OFF_S), (3.0, CALLS * [0.5])],
    ids=["hangs up at once", "hangs up soon", "stays a while"],
)
def test_the_driver_backs_off_from_a_robot_that_hangs_up_at_once(monkeypatch, lasts_s, expected_s):
    clock = types.SimpleNamespace(now_s=1000.0)
    monkeypatch.setattr(dialer, "time", types.SimpleNamespace(monotonic=lambda: clock.now_s))
    monkeypatch.setattr(dialer, "_connect", lambda address: None)

    def hand_over(sock, address, note_closed):
        assert threading.current_thread().daemon, "it would keep the driver from ending"
        clock.now_s += lasts_s
        note_closed()

    ended = Ended()
    start_dialer(ADDRESS, hand_over, lambda text: None, ended)
    assert ended.is_over.wait(60.0)
    assert ended.waits_s == expected_s


def test_why_a_robot_cannot_be_reached_is_said_once_until_it_changes(monkeypatch):
    refused, no_route = OSError(111, "refused"), OSError(113, "no route")
    errors = iter([refused] * 3 + [no_route] * 2 + [None] + [no_route] * 2)

    def connect(address):
        error = next(errors)
        if error is not None:
            raise error

    monkeypatch.setattr(dialer, "_connect", connect)
    ended, texts = Ended(), []
    start_dialer(ADDRESS, lambda sock, address, note_closed: note_closed(), texts.append, ended)
    assert ended.is_over.wait(60.0)
    assert [text.partition("reached: ")[2].partition(";")[0] for text in texts] == ["refused", "no route", "no route"]
    assert ended.waits_s == BACKED_OFF_S
