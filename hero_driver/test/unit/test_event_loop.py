"""A real loop with real connections: what it reads, and how it ends."""

import contextlib
import errno
import os
import socket
import struct
import threading
from unittest.mock import create_autospec

import pytest

from hero_driver.transport import event_loop
from hero_driver.transport.event_loop import EventLoop, NoAnswerError
from hero_driver.transport.link import LinkHandler

DEADLINE_S = 60.0


class Handler(LinkHandler):
    """Notes what comes when."""

    def __init__(self):
        self.changed = threading.Condition()
        self.reads = []  # pairs: bytes, when they were read
        self.endings = []
        self.loop = self.thread = None

    def open_link(self, link):
        """Take everybody."""

    def receive_data(self, link, data, now_s):
        with self.changed:
            self.reads.append((data, now_s))
            self.changed.notify_all()

    def poll(self, now_s):
        """Have nothing to do."""

    def poll_link(self, link, now_s):
        """Have nothing to do."""

    def resume(self, now_s):
        """Have nothing to do."""

    def close_link(self, link, reason):
        with self.changed:
            self.endings.append(reason)
            self.changed.notify_all()

    def wait(self, condition):
        with self.changed:
            assert self.changed.wait_for(condition, DEADLINE_S)


@pytest.fixture
def start():
    loops = []

    def start_loop(host="127.0.0.1"):
        handler = Handler()
        handler.loop = EventLoop(host, 0, 1.0)
        handler.loop.open(handler)
        thread = threading.Thread(target=handler.loop.run, daemon=True)
        thread.start()
        handler.thread = thread
        loops.append((handler.loop, thread))
        return handler, socket.create_connection(handler.loop.listening)

    yield start_loop
    for loop, thread in loops:
        loop.stop()
        thread.join(DEADLINE_S)


def test_a_connection_that_breaks_is_closed_at_once_with_the_reason(start):
    handler, far = start()
    far.sendall(b"first")
    handler.wait(lambda: len(handler.reads) == 1)
    far.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    far.close()
    handler.wait(lambda: handler.endings)
    assert handler.endings == ["read failed: Connection reset by peer"]


def has_ipv6():
    """Whether this PC has addresses of IPv6; containers often have none."""
    try:
        with socket.socket(socket.AF_INET6) as sock:
            sock.bind(("::1", 0))
    except OSError:
        return False
    return True


@pytest.mark.skipif(not has_ipv6(), reason="this PC has no IPv6")
def test_robots_are_heard_on_all_addresses_of_ipv6_and_ipv4(start):
    handler, far = start("::")
    assert str(handler.loop.listening) == "[::]:%d" % handler.loop.listening.port
    with far, socket.create_connection(("127.0.0.1", handler.loop.listening.port)) as near:
        far.sendall(b"six")
        near.sendall(b"four")
        handler.wait(lambda: {data for data, _ in handler.reads} == {b"six", b"four"})


def test_the_end_of_the_loop_closes_every_file_that_it_opened(start):
    before = set(os.listdir("/proc/self/fd"))
    handler, far = start()
    with far:
        far.sendall(b"first")
        handler.wait(lambda: handler.reads)
        handler.loop.stop()
        handler.wait(lambda: handler.endings)
        handler.thread.join(DEADLINE_S)
    assert set(os.listdir("/proc/self/fd")) == before


def test_a_call_after_the_end_of_the_loop_does_no_harm(start):
    handler, far = start()
    far.close()
    handler.loop.stop()
    handler.thread.join(DEADLINE_S)
    calls = []
    handler.loop.call_soon(lambda: calls.append("late"))
    assert calls == []


def test_connections_notice_a_peer_that_vanished_and_delay_nothing():
    with socket.socket() as near:
        for timeout_s, idle_s in ((8.0, 4), (1.0, 1)):
            EventLoop("127.0.0.1", 0, timeout_s)._set_options(near)
            tcp = {
                socket.TCP_NODELAY: 1,
                socket.TCP_KEEPIDLE: idle_s,
                socket.TCP_KEEPINTVL: 1,
                socket.TCP_KEEPCNT: 3,
                socket.TCP_USER_TIMEOUT: int(1000 * timeout_s),
            }
            assert {option: near.getsockopt(socket.IPPROTO_TCP, option) for option in tcp} == tcp
            assert near.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1 and not near.getblocking()


class Notes(Handler):
    """Notes also what the loop says of bugs and of the network."""

    def __init__(self):
        super().__init__()
        self.bugs, self.warnings, self.resumed = [], [], []
        self.refusal = None

    def open_link(self, link):
        if isinstance(self.refusal, Exception):
            raise self.refusal
        return self.refusal

    def resume(self, now_s):
        self.resumed.append(now_s)

    def report_bug(self, error):
        self.bugs.append(error)

    def warn_network(self, text):
        self.warnings.append(text)


@pytest.fixture(name="still_loop")
def make_still_loop():
    """Give a loop that a test turns by hand, and its handler."""
    loop, handler = EventLoop("127.0.0.1", 0, 1.0), Notes()
    loop.open(handler)
    loop._thread_id = threading.get_ident()
    yield loop, handler
    loop._close_all()


class Stub:
    """A reader, or a socket, of which a test says what it does."""

    def __init__(self, **methods):
        self.__dict__.update(methods)


def connect(loop):
    """Return both ends of a connection that the loop has taken; its own is None if it was closed."""
    far = socket.create_connection(loop.listening)
    before = set(loop._links)
    loop._run_once()
    return next((link for number, link in loop._links.items() if number not in before), None), far


@pytest.mark.parametrize(("file_limit", "last"), [(100, 74), (256, 191), (260, 195), (1024, 959)])
def test_the_last_files_are_kept_for_others_than_robots(still_loop, file_limit, last):
    loop, handler = still_loop
    taken, closed, later = [], [], []
    loop._file_limit, listener = file_limit, loop._listener
    loop._add_link = lambda sock, address: taken.append((sock.fileno(), str(address)))
    loop.call_later = lambda delay_s, call: later.append((delay_s, call))
    for number in (last, last + 1):
        sock = Stub(fileno=lambda number=number: number, close=lambda: closed.append("refused"))
        loop._listener = Stub(accept=lambda sock=sock: (sock, ("10.0.0.1", 5, 0, 0)), fileno=listener.fileno)
        loop._accept()
    assert taken == [(last, "10.0.0.1:5")] and closed == ["refused"]
    assert handler.warnings == [
        "cannot take more connections (Too many open files); raise the limit of open files (ulimit -n) and start again;"
        " connected robots are not affected"
    ]
    ((delay_s, resume),) = later
    assert delay_s == 0.5 and listener.fileno() not in loop._serves
    loop._listener = None  # the loop has ended meanwhile
    resume()
    assert listener.fileno() not in loop._serves
    loop._listener = listener
    resume()
    assert listener.fileno() in loop._serves


@pytest.mark.parametrize(
    ("error", "warnings"), [(errno.EMFILE, 1), (errno.ENFILE, 1), (errno.ENETDOWN, 1), (errno.EAGAIN, 0)]
)
def test_an_accept_that_fails_is_said_with_a_remedy_if_there_is_one(still_loop, error, warnings):
    loop, handler = still_loop
    listener = loop._listener

    def accept():
        raise OSError(error, os.strerror(error))

    loop._listener = Stub(accept=accept, fileno=listener.fileno)
    loop._accept()
    assert len(handler.warnings) == warnings
    assert all(("ulimit" in text) == (error != errno.ENETDOWN) for text in handler.warnings)
    loop._listener = listener


def test_calls_and_timers_run_in_order_and_one_that_fails_harms_no_other(still_loop, monkeypatch):
    loop, handler = still_loop
    now_s, ran = [1000.0], []
    monkeypatch.setattr(event_loop.time, "monotonic", lambda: now_s[0])
    loop._timers.clear()
    loop.call_later(0.2, lambda: ran.append("later"))
    loop.call_later(0.1, lambda: ran.append("first"))
    loop.call_later(0.1, lambda: ran.append("second"))
    loop.call_later(0.1, lambda: ran.append(1 / 0))
    loop._turned_s = now_s[0] + 0.2
    for after_s, expected in ((0.099, []), (0.1, ["first", "second"]), (0.2001, ["first", "second", "later"])):
        now_s[0] = 1000.0 + after_s
        loop.call_soon(lambda: ran.append("soon"))
        loop._run_once()
        assert [name for name in ran if name != "soon"] == expected
    assert ran.count("soon") == 3 and [type(error) for error in handler.bugs] == [ZeroDivisionError]


def test_the_longest_recent_time_without_a_turn_is_known(still_loop, monkeypatch):
    (loop, _), now_s = still_loop, [1000.0]
    monkeypatch.setattr(event_loop.time, "monotonic", lambda: now_s[0])
    monkeypatch.setattr(event_loop.time, "clock_gettime", lambda clock: now_s[0])
    for pause_s, lateness_s in ((0.0, 0.0), (0.09, 0.0), (0.3, 0.3), (0.2, 0.3), (0.05, 0.3)):
        now_s[0] += pause_s
        loop._look_for_pause()
        assert loop.find_lateness_s() == pytest.approx(lateness_s)
    for _ in range(100):
        now_s[0] += 0.051
        loop._look_for_pause()
    assert loop.find_lateness_s() == 0.0
    now_s[0] += 0.15
    loop._look_for_pause()
    assert loop.find_lateness_s() == pytest.approx(0.15)


@pytest.mark.parametrize(("pause_s", "is_pause"), [(0.9, False), (1.1, True)])
def test_a_pause_of_more_than_a_second_is_told_to_all_who_read(still_loop, monkeypatch, pause_s, is_pause):
    loop, handler = still_loop
    now_s, told = [1000.0], []
    monkeypatch.setattr(event_loop.time, "monotonic", lambda: now_s[0])
    monkeypatch.setattr(event_loop.time, "clock_gettime", lambda clock: now_s[0])
    loop._readers |= {Stub(resume=lambda: told.append("reader"), close=lambda: None) for _ in range(2)}
    loop._look_for_pause()
    assert not handler.resumed and not loop.has_resumed_within(1e9), "the first look"
    now_s[0] += pause_s
    loop._look_for_pause()
    assert (handler.resumed, told) == (([now_s[0]], ["reader"] * 2) if is_pause else ([], []))
    now_s[0] += 0.5
    assert loop.has_resumed_within(0.6) == is_pause and not loop.has_resumed_within(0.5)


def test_a_connection_that_is_refused_or_meets_a_bug_is_closed(still_loop):
    loop, handler = still_loop
    for refusal, reason in (("no room", "no room"), (KeyError("ours"), "a bug of the driver")):
        handler.refusal = refusal
        link, far = connect(loop)
        assert link is None and handler.endings.pop() == reason
        assert far.recv(1) == b""
        far.close()
    assert len(handler.bugs) == 1


def test_a_bug_with_the_data_of_one_robot_closes_its_connection_only(still_loop):
    loop, handler = still_loop
    (bad, bad_far), (good, good_far) = connect(loop), connect(loop)
    handler.receive_data = lambda link, data, now_s: {good: handler.reads}[link].append(data)
    for far in (bad_far, good_far):
        far.sendall(b"data")
    loop._run_once()
    assert handler.endings == ["a bug of the driver"] and handler.reads == [b"data"]
    assert bad.closed and not good.closed and len(handler.bugs) == 1
    for far in (bad_far, good_far):
        far.close()


def test_a_socket_that_breaks_before_it_is_served_is_given_back(still_loop):
    loop, handler = still_loop
    near, far = socket.socketpair()
    far.close()
    loop._add_link(near, "10.0.0.7:11411")
    assert near.fileno() == -1 and not loop._links
    assert handler.warnings[0].startswith("connection of 10.0.0.7:11411 broke at once: ")


def test_what_did_not_fit_is_sent_when_the_peer_reads(still_loop):
    loop, _ = still_loop
    link, far = connect(loop)
    link._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    sent = 0
    while not link.is_full:
        link.send_packet(bytes(1000))
        sent += 1000
    received = 0
    far.setblocking(False)
    while received < sent:
        with contextlib.suppress(BlockingIOError):
            received += len(far.recv(1 << 20))
        loop._timers.clear()
        loop.call_later(0.0, lambda: None)
        loop._run_once()
    assert received == sent and not link.is_full
    far.close()


def test_a_reader_is_read_until_it_ends_or_fails(still_loop):
    loop, handler = still_loop
    for answers, bugs in (([True, False], 0), ([True, None], 1)):
        near, far = socket.socketpair()
        far.sendall(b"data")
        closed = threading.Event()

        def read(answers=answers):
            answer = answers.pop(0)
            return {}[answer] if answer is None else answer

        reader = Stub(fileno=near.fileno, read=read, resume=lambda: None, close=closed.set)
        loop._watch_reader(reader)
        for is_closed in (False, True):
            loop._run_once()
            assert closed.is_set() == is_closed == (reader not in loop._readers)
        assert len(handler.bugs) == bugs
        near.close()
        far.close()


def test_the_loop_waits_for_its_next_timer_and_not_at_all_for_calls(still_loop, monkeypatch):
    loop, _ = still_loop
    now_s, timeouts, epoll = 1000.0, [], loop._epoll
    monkeypatch.setattr(event_loop.time, "monotonic", lambda: now_s)
    monkeypatch.setattr(loop, "_epoll", Stub(poll=lambda timeout_s: timeouts.append(timeout_s) or ()))
    loop._turned_s = now_s
    loop._timers.clear()
    loop._run_once()
    loop.call_later(0.25, lambda: None)
    loop.call_later(0.5, lambda: None)
    loop._run_once()
    loop.call_soon(lambda: None)
    loop._run_once()
    loop._turned_s = now_s + 1.0
    loop._run_once()
    assert timeouts == [None, 0.25, 0.0, 0.0]
    loop._epoll = epoll


def test_what_woke_the_loop_is_taken_and_wakes_it_once(still_loop):
    loop, _ = still_loop
    loop._wake_sender.send(b"123")
    loop._run_once()
    with pytest.raises(BlockingIOError):
        loop._wake_receiver.recv(1)


def test_calls_that_pile_up_do_not_keep_the_loop_from_ending(still_loop):
    loop, _ = still_loop
    ran = []
    loop._thread_id = None  # as another thread
    for _ in range(event_loop.CALLS_MAX + 1):
        loop.call_soon(lambda: ran.append("other"))
    loop._thread_id = threading.get_ident()
    loop.call_soon(lambda: ran.append("own"))
    loop._thread_id = None
    loop.stop()
    loop._run_once()
    assert ran == ["other"] * event_loop.CALLS_MAX + ["own"] and not loop._is_running


def test_a_loop_that_does_not_run_answers_nobody():
    loop = EventLoop("127.0.0.1", 0, 1.0)
    with pytest.raises(NoAnswerError, match="the driver did not answer within 0.0 s"):
        loop.ask(lambda answer: answer("late"), 0.0)
    assert loop._calls.waiting
    loop._close_all()


def test_the_end_of_a_connection_is_told_once(still_loop):
    loop, handler = still_loop
    assert not loop._listener.getblocking()
    far = socket.create_connection(loop.listening)
    near, _ = loop._listener.accept()
    loop._add_link(near, "10.0.0.7:11411")
    (link,) = loop._links.values()
    for _ in range(2):
        link.close("the end")
    assert handler.endings == ["the end"] and not loop._links
    far.close()


def test_the_loop_listens_where_it_was_told_to():
    loop = EventLoop("127.0.0.2", 0, 1.0)
    loop.open(Notes())
    assert loop.listening.host == "127.0.0.2"
    again = EventLoop("127.0.0.2", loop.listening.port, 1.0)
    descriptors = os.listdir("/proc/self/fd")
    with pytest.raises(OSError, match="in use") as refused:
        again.open(Notes())
    assert os.listdir("/proc/self/fd") == descriptors, refused
    for opened in (loop, again):
        opened._close_all()


def test_the_handler_and_every_other_link_are_polled_though_each_fails(still_loop, monkeypatch):
    loop, handler = still_loop
    links, polled = [Stub(closed=closed) for closed in (False, False, True, False)], []
    loop._timers.clear()
    monkeypatch.setattr(event_loop.time, "monotonic", lambda: 1000.0)
    monkeypatch.setattr(loop, "_links", dict(enumerate(links, 5)))
    handler.poll = lambda now_s: polled.append(now_s) or 1 / 0
    handler.poll_link = lambda link, now_s: polled.append(links.index(link)) or 1 / 0
    loop._poll()
    first = polled[:]
    assert [(due_s, call) for due_s, _, call in loop._timers] == [(1000.05, loop._poll)]
    loop._poll()
    assert first == [1000.0, 1, 3] and polled[3:] == [1000.0, 0] and len(handler.bugs) == 5


@pytest.mark.parametrize("error", [None, RuntimeError, MemoryError, SystemExit, KeyboardInterrupt])
@pytest.mark.parametrize("stop_error", [None, ArithmeticError])
def test_whatever_ends_the_loop_robots_stop_before_connections_close(monkeypatch, error, stop_error):
    handler, steps = Handler(), []
    loop = EventLoop("127.0.0.1", 0, 1.0)
    loop.open(handler)
    close_all = loop._close_all

    def stop():
        steps.append("stop")
        if stop_error is not None:
            raise stop_error

    def break_down():
        loop._end()
        if error is not None:
            raise error

    handler.stop_at_end = stop
    monkeypatch.setattr(loop, "_run_once", break_down)
    monkeypatch.setattr(loop, "_close_all", lambda: (steps.append("close"), close_all()))
    raised = stop_error or error
    with pytest.raises(raised) if raised else contextlib.nullcontext():
        loop.run()
    assert steps == ["stop", "close"]


def test_all_robots_of_a_lab_may_connect_at_once(monkeypatch):
    create = create_autospec(socket.create_server, side_effect=socket.create_server)
    monkeypatch.setattr(event_loop.socket, "create_server", create)
    event_loop._listen("127.0.0.1", 0).close()
    assert create.call_args[1]["backlog"] >= 200
