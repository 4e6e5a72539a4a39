"""The fleet monitor beside the tests: asked without a browser, and a second one of one's own."""

import http.client
import os
import signal
import subprocess
import uuid

from swarm_watch import wait_for

TIMEOUT_S = 30.0
HOST = "127.0.0.1:21331"
OTHER_HOST = "127.0.0.1:21332"
UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


def ask(host, path="/", headers=(), method="GET", body=None):
    """Return status, headers and body of the answer to one request."""
    connection = http.client.HTTPConnection(host, timeout=TIMEOUT_S)
    connection.request(method, path, body, dict(headers))
    answer = connection.getresponse()
    text = b"" if answer.status == 101 else answer.read()
    connection.close()
    return answer.status, answer.headers, text.decode("utf-8", "replace")


def start_monitor(*arguments):
    """Start a second monitor. Its name is new: private parameters outlive a node."""
    name = "__name:=monitor_" + uuid.uuid4().hex
    port = "_port:=" + OTHER_HOST.rpartition(":")[2]
    return subprocess.Popen(
        ["rosrun", "hero_bringup", "monitor", name, port, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def end(process):
    """End a program and return what it printed."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGTERM)
    return process.communicate(timeout=TIMEOUT_S)[0].decode()


def wait_until_it_answers(host):
    def answers():
        try:
            return ask(host)[0] == 200
        except OSError:
            return False

    wait_for(answers, TIMEOUT_S, "an answer of " + host)
