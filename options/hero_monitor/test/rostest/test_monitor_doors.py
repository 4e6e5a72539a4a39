#!/usr/bin/env python3
"""The fleet monitor beset by clients without the token: those who know it get in, and their STOP ALL works."""

import contextlib
import itertools
import resource
import select
import selectors
import socket
import tempfile
import threading
import unittest
from pathlib import Path

import rospy
import rostest
from monitor_process import (
    OTHER_HOST,
    OTHER_PORT,
    TIMEOUT_S,
    PageClient,
    ask,
    end,
    log_in,
    make_frame,
    start_monitor,
    start_scripted_driver,
    wait_until_it_answers,
)
from std_msgs.msg import Bool

from hero_msgs.msg import RobotArray
from hero_test.waiting import wait_for

TOKEN = "correct-horse-battery-staple"
PEERS = 1100
PEER_ADDRESSES = ["127.0.0.%d" % number for number in range(2, 32)]
SILENT_ADDRESS = "127.0.0.99"
FILES = 1024  # a usual soft limit
CONNECTIONS_MAX, CONNECTIONS_MAX_PER_ADDRESS = 400, 50  # the monitor's defaults


def connect(address):
    """Return a connection of somebody who sends the begin of a request and nothing more."""
    opened = socket.create_connection(("127.0.0.1", OTHER_PORT), TIMEOUT_S, (address, 0))
    opened.sendall(b"GET / HTTP/1.1\r\nHost: ")
    return opened


class DoorsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
        cls.drivers = [start_scripted_driver("hero_driver", [0]), start_scripted_driver("hero_driver_b", [100])]
        cls.stopped = {}
        for name in ("hero_driver", "hero_driver_b"):
            rospy.Subscriber("/%s/robots" % name, RobotArray, cls.receive, name)
        # A driver that starts after a stop was confirmed is not asked.
        wait_for(lambda: len(cls.stopped) == 2, "both drivers")
        cls.folder = tempfile.TemporaryDirectory()
        file = Path(cls.folder.name) / "token"
        file.touch(mode=0o600)
        file.write_text(TOKEN)
        limited = ["prlimit", "--nofile=%d:" % FILES]
        cls.monitor = start_monitor("_host:=0.0.0.0", "_token_file:=%s" % file, prefix=limited)
        wait_until_it_answers(OTHER_HOST)
        # The only one of its address, which keeps its place among those of others.
        cls.silent = connect(SILENT_ADDRESS)

    @classmethod
    def tearDownClass(cls):
        cls.silent.close()
        for driver in cls.drivers:
            end(driver)
        cls.folder.cleanup()
        output = end(cls.monitor)
        assert "Traceback" not in output, output

    @classmethod
    def receive(cls, message, name):
        cls.stopped[name] = message.stopped

    def setUp(self):
        self.sockets = []
        self.addCleanup(lambda: [opened.close() for opened in self.sockets])

    def connect_peers(self, *addresses):
        """Connect 1100 times, from these addresses in turn."""
        for number in range(PEERS):
            self.sockets.append(connect(addresses[number % len(addresses)]))

    def wait_for_evictions(self, left):
        """Wait until the monitor has accepted all connections and keeps only so many: those of the others end."""
        waiting = select.poll()
        for opened in self.sockets:
            waiting.register(opened, select.POLLIN)
        wait_for(lambda: len(waiting.poll(0)) >= len(self.sockets) - left, "connections to be closed")

    def open_page(self):
        status, cookie = log_in(OTHER_HOST, TOKEN)
        self.assertEqual(status, 204)
        self.sockets.append(PageClient(OTHER_HOST, cookie))
        return self.sockets[-1]

    def wait_until_stopped(self, stopped):
        wait_for(lambda: list(self.stopped.values()) == [stopped] * 2, "stopped: %s" % stopped)

    def release(self):
        """Release all robots, which pages can do only a while after a stop."""
        publishers = [rospy.Publisher("/%s/stop_request" % name, Bool, queue_size=1) for name in self.stopped]
        for publisher in publishers:
            wait_for(publisher.get_num_connections, "a driver")

        def ask():
            # Again and again: a monitor that has not heard of its own stop yet goes on asking for it.
            for publisher in publishers:
                publisher.publish(False)
            return list(self.stopped.values()) == [False] * 2

        wait_for(ask, "the release")

    def test_a_page_opened_among_1100_untrusted_peers_stops_all_robots(self):
        self.connect_peers(*PEER_ADDRESSES)
        self.wait_for_evictions(CONNECTIONS_MAX)
        page = self.open_page()
        page.send(do="stop")
        self.wait_until_stopped(True)
        self.release()

    def test_a_page_that_is_open_stays_when_1100_untrusted_peers_come(self):
        page = self.open_page()
        self.connect_peers(*PEER_ADDRESSES)
        page.send(do="stop")
        self.wait_until_stopped(True)
        self.release()

    def test_1100_connections_of_one_address_leave_others_alone(self):
        self.connect_peers(PEER_ADDRESSES[0])
        self.wait_for_evictions(CONNECTIONS_MAX_PER_ADDRESS)
        self.assertEqual(ask(OTHER_HOST, source=PEER_ADDRESSES[1])[0], 200)
        self.open_page().send(do="stop")
        self.wait_until_stopped(True)
        self.release()

    def send_without_pause(self, address, end):
        """Send requests on many connections, many at once, and read the answers, until end is set."""
        chosen = selectors.DefaultSelector()
        while not end.is_set():
            while len(chosen.get_map()) < CONNECTIONS_MAX_PER_ADDRESS:
                opened = socket.create_connection(("127.0.0.1", OTHER_PORT), TIMEOUT_S, (address, 0))
                opened.setblocking(False)
                chosen.register(opened, selectors.EVENT_READ | selectors.EVENT_WRITE)
            for key, events in chosen.select(TIMEOUT_S):
                try:
                    if events & selectors.EVENT_WRITE:
                        key.fileobj.send(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" * 50)
                    is_open = not events & selectors.EVENT_READ or key.fileobj.recv(65536)
                except BlockingIOError:
                    continue
                except OSError:
                    is_open = False
                if not is_open:
                    chosen.unregister(key.fileobj)
                    key.fileobj.close()
        for key in list(chosen.get_map().values()):
            key.fileobj.close()

    def test_requests_without_pause_keep_no_page_from_stopping_all_robots(self):
        end = threading.Event()
        flood = threading.Thread(target=self.send_without_pause, args=(PEER_ADDRESSES[0], end))
        flood.start()
        self.addCleanup(flood.join)
        self.addCleanup(end.set)
        self.open_page().send(do="stop")
        self.wait_until_stopped(True)
        self.release()

    def test_messages_without_pause_keep_no_page_from_stopping_all_robots(self):
        page = self.open_page()
        _, cookie = log_in(OTHER_HOST, TOKEN)
        for frame in (make_frame(0x89, b"a ping"), make_frame(0x81, b'{"do": "stop_some", "robots": ["hero_0"]}')):
            client, is_sending = PageClient(OTHER_HOST, cookie), threading.Event()
            client.end.set()  # here pongs go with the rest: two threads would mix their frames
            flooding = 100 * frame + make_frame(0x8A, b"")

            def send_without_pause(client=client, flooding=flooding, is_sending=is_sending):
                for count in itertools.count():
                    try:
                        client.socket.sendall(flooding)
                    except OSError:
                        break  # the test has shut it down
                    with contextlib.suppress(BlockingIOError):
                        client.socket.recv(1 << 20, socket.MSG_DONTWAIT)
                    if count == 10:
                        is_sending.set()

            flood = threading.Thread(target=send_without_pause)
            flood.start()
            self.assertTrue(is_sending.wait(TIMEOUT_S))
            page.send(do="stop")
            self.wait_until_stopped(True)
            self.assertTrue(flood.is_alive())
            client.socket.shutdown(socket.SHUT_RDWR)
            flood.join()
            client.close()
            self.release()

    def test_a_connection_that_sends_no_request_is_closed(self):
        self.assertEqual(self.silent.recv(1), b"")

    def test_wrong_tokens_of_one_address_keep_no_other_from_logging_in(self):
        peer, owner = PEER_ADDRESSES[:2]
        self.assertEqual(log_in(OTHER_HOST, "wrong", peer)[0], 403)

        def is_refused():
            while log_in(OTHER_HOST, "wrong", peer)[0] != 429:
                continue
            # A busy PC may take so long that it has one more try by then.
            return log_in(OTHER_HOST, TOKEN, peer)[0] == 429

        wait_for(is_refused, "the end of its tries")
        status, cookie = log_in(OTHER_HOST, TOKEN, owner)
        self.assertEqual(status, 204)
        # Who is logged in gets in from anywhere.
        self.assertIn("main.js", ask(OTHER_HOST, "/", {"Cookie": cookie}, source=peer)[2])


if __name__ == "__main__":
    rospy.init_node("test_monitor_doors")
    rostest.rosrun("hero_monitor", "test_monitor_doors", DoorsTest)
