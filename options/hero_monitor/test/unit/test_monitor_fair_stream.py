"""Clients are read in turns, and those that leave what they get unread are closed; timers by the monotonic clock."""

import asyncio
import socket
import time
from contextlib import suppress
from types import SimpleNamespace

import pytest
import tornado.ioloop
from tornado.iostream import StreamClosedError

from hero_monitor.serving import fair_stream as module
from hero_monitor.serving.fair_stream import FairStream
from hero_monitor.serving.server import MonotonicLoop

REST_FACTOR, REST_MAX_S, TURN_S, UNREAD_WRITES_MAX = 3.0, 0.05, 0.001, 1000


class EndlessStream(FairStream):
    """The connection of a client that sends without a pause."""

    def read_from_fd(self, buf):
        buf[:] = b"\r" * len(buf)
        return len(buf)


@pytest.fixture(name="pair")
def make_pair():
    pair = socket.socketpair()
    yield pair
    for each in pair:
        each.close()


@pytest.fixture(name="clock")
def make_clock(monkeypatch):
    """A clock that shows step_s more each time it is read, and the rests."""
    clock = SimpleNamespace(now_s=0.0, step_s=0.0, rests_s=[])

    def read():
        clock.now_s += clock.step_s
        return clock.now_s

    async def sleep(duration_s, sleep=asyncio.sleep):
        clock.rests_s.append(duration_s)
        clock.now_s += duration_s
        await sleep(0)

    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=read))
    monkeypatch.setattr(module, "asyncio", SimpleNamespace(sleep=sleep))
    return clock


@pytest.mark.parametrize("read", [lambda stream: stream.read_bytes(1), lambda stream: stream.read_until_regex(b"\r")])
def test_a_client_that_sends_without_a_pause_leaves_others_their_turns(pair, clock, read):
    reads, reads_before_turn = [], []

    async def run():
        stream = EndlessStream(pair[0])

        async def read_all():
            for _ in range(1000):
                reads.append(await read(stream))

        flood = asyncio.ensure_future(read_all())
        while not flood.done():
            await asyncio.sleep(0)
            reads_before_turn.append(len(reads))
        stream.close()

    clock.step_s = TURN_S / 10
    asyncio.run(run())
    between = [after - before for before, after in zip(reads_before_turn, reads_before_turn[1:])]
    assert len(reads) == 1000 and max(between) <= 11
    assert clock.rests_s[1:] == [pytest.approx(REST_FACTOR * TURN_S, rel=0.2)] * len(clock.rests_s[1:])


def test_the_rest_after_a_long_request_is_bounded(pair, clock):
    async def run():
        clock.step_s = TURN_S
        stream = EndlessStream(pair[0])
        await stream.read_bytes(1)
        assert clock.rests_s == [REST_FACTOR * TURN_S], "a turn that is used up is over"
        clock.rests_s.clear()
        clock.step_s = 0.0
        stream = EndlessStream(pair[0])
        await stream.read_bytes(1)
        assert clock.rests_s == [], "no client rests before it has worked"
        clock.step_s = 10.0
        await stream.read_bytes(1)
        stream.close()

    asyncio.run(run())
    assert clock.rests_s == [REST_MAX_S]


def test_a_client_that_reads_nothing_is_closed(pair):
    async def run():
        stream, writes = FairStream(pair[0]), []

        async def leave_unread():
            writes.append(stream.write(bytes(5000)))
            while writes[-1].done():  # into the buffers of the kernel
                await asyncio.sleep(0)
                writes.append(stream.write(bytes(5000)))
            for _ in range(UNREAD_WRITES_MAX - 1):
                writes.append(stream.write(bytes(5000)))

        await leave_unread()
        pair[1].setblocking(False)
        while not writes[-1].done():
            with suppress(BlockingIOError):
                pair[1].recv(10**6)
            await asyncio.sleep(0)
        await asyncio.sleep(0)
        await leave_unread()
        assert not stream.closed()
        with pytest.raises(StreamClosedError):
            stream.write(b"x")
        assert stream.closed()
        with pytest.raises(StreamClosedError):
            await writes[-1]

    asyncio.run(run())


def test_a_client_that_reads_gets_any_number_of_writes(pair):
    async def run():
        stream = FairStream(pair[0])
        for _ in range(3 * UNREAD_WRITES_MAX):
            await stream.write(b"x")
            pair[1].recv(1)
        assert not stream.closed()
        stream.close()

    asyncio.run(run())


def test_timers_run_on_when_the_clock_of_the_pc_is_set_back(monkeypatch):
    loop = MonotonicLoop()
    calls, wall_s = [], iter(range(10**9, 0, -3600))
    monkeypatch.setattr(time, "time", lambda: float(next(wall_s)))

    def step():
        calls.append(loop.time())
        if len(calls) == 3:
            loop.stop()

    repeated = tornado.ioloop.PeriodicCallback(step, 1.0)
    loop.add_callback(repeated.start)
    loop.call_later(30.0, loop.stop)
    loop.start()
    repeated.stop()
    loop.close()
    assert len(calls) == 3
