"""The fleet monitor beside the tests: asked without a browser, and a second one of one's own."""

import contextlib
import http.client
import json
import os
import signal
import socket
import subprocess
import threading
import uuid

import rosgraph
import rospy

from hero_test.processes import find_program
from hero_test.waiting import wait_for

TIMEOUT_S = 300.0  # only a test that fails waits so long; a busy machine needs its time
PORT = rospy.get_param("/hero_monitor/port")
OTHER_PORT = PORT + 1  # two rostests may run side by side
HOST, OTHER_HOST = ("127.0.0.1:%d" % port for port in (PORT, OTHER_PORT))
UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


def ask(host, path="/", headers=(), method="GET", body=None, source="127.0.0.1"):
    """Return status, headers and body of the answer to one request; source: the client's address."""
    connection = http.client.HTTPConnection(host, timeout=TIMEOUT_S, source_address=(source, 0))
    connection.request(method, path, body, dict(headers))
    answer = connection.getresponse()
    text = b"" if answer.status == 101 else answer.read()
    connection.close()
    return answer.status, answer.headers, text.decode("utf-8", "replace")


def log_in(host, token, source="127.0.0.1"):
    """Return the status of a login and the cookie that it gives."""
    body = json.dumps({"token": token})
    status, headers, _ = ask(host, "/login", {"Origin": "http://" + host}, "POST", body, source)
    return status, (headers["Set-Cookie"] or "").partition(";")[0]


def make_frame(kind, content):
    """Return a short WebSocket frame, with a mask of zeros (RFC 6455, section 5.2)."""
    return bytes([kind, 0x80 | len(content), 0, 0, 0, 0]) + content


class PageClient:
    """The socket of a page, without a browser: sends requests, and reads nothing."""

    def __init__(self, host, cookie=""):
        address, _, port = host.rpartition(":")
        self.socket = socket.create_connection((address, int(port)), TIMEOUT_S)
        lines = ["GET /live HTTP/1.1", "Host: " + host, "Origin: http://" + host, "Cookie: " + cookie]
        lines += ["%s: %s" % item for item in UPGRADE.items()]
        self.socket.sendall("\r\n".join([*lines, "", ""]).encode())
        assert b"101" in self.socket.recv(12), "no socket for this page"
        self.end = threading.Event()
        threading.Thread(target=self.keep_open, daemon=True).start()

    def keep_open(self):
        """Answer the pings that nobody reads: the monitor closes pages that do not."""
        with contextlib.suppress(OSError):
            while not self.end.wait(1.0):
                self.socket.sendall(b"\x8a\x80\0\0\0\0")

    def send(self, **request):
        self.socket.sendall(make_frame(0x81, json.dumps(request).encode()))

    def close(self):
        self.end.set()
        self.socket.close()


def start_monitor(*arguments, prefix=()):
    """Start a second monitor. Its name is new: private parameters outlive a node."""
    name = "__name:=monitor_" + uuid.uuid4().hex
    port = "_port:=%d" % OTHER_PORT
    return subprocess.Popen(
        [*prefix, find_program("hero_monitor", "monitor"), name, port, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def start_scripted_driver(name, ids, prefix=(), **parameters):
    """Start a driver that reports robots with these ids."""
    private = ["_%s:=%s" % item for item in parameters.items()]
    program = find_program("hero_test", "scripted_driver")
    return subprocess.Popen(
        [*prefix, program, "__name:=" + name, "_ids:='%s'" % json.dumps(ids), *private],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def start_master(port):
    """Start a ROS master; return it as soon as it answers."""
    process = subprocess.Popen(["rosmaster", "--core", "-p", str(port)], start_new_session=True)
    uri = "http://127.0.0.1:%d" % port
    wait_for(lambda: rosgraph.Master("/test", uri).is_online(), "the master at " + uri)
    return process


def end(process):
    """End a program and return what it printed."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGTERM)
    return (process.communicate(timeout=TIMEOUT_S)[0] or b"").decode()


def wait_until_it_answers(host):
    def answers():
        try:
            return ask(host)[0] == 200
        except OSError:
            return False

    wait_for(answers, "an answer of " + host)
