"""script/demo as a user meets it: it ends well, names what failed, finds another port, and Ctrl-C ends everything."""

import os
import pty
import re
import signal
import socket
import subprocess
import threading
from pathlib import Path

import pytest

from hero_test.processes import find_free_port
from hero_test.waiting import wait_for

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT_S = 120.0


@pytest.fixture()
def demo():
    """Starts script/demo without a display; what a failed test leaves is ended."""
    started = []

    def start(*arguments):
        environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
        process = subprocess.Popen(
            [str(ROOT / "script" / "demo"), *arguments],
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        started.append(process)
        return process

    yield start
    for process in started:
        if process.poll() is None:
            process.terminate()
            process.communicate(timeout=TIMEOUT_S)


@pytest.fixture()
def taken_port():
    """A port on which somebody else listens."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield other.getsockname()[1]


def read_to_end(process):
    return process.communicate(timeout=TIMEOUT_S)[0].decode()


def listens(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def wait_until_driver_listens(port):
    wait_for(lambda: listens(port), f"the driver on port {port}", TIMEOUT_S)


def test_it_ends_when_all_robots_moved_also_on_another_port(demo, taken_port):
    process = demo("--seconds", "12", "--count", "2", "--port", str(taken_port))
    output = read_to_end(process)
    assert process.returncode == 0, output
    assert f"port {taken_port} is taken" in output
    assert "all 2 robots joined and moved" in output


def test_robots_that_did_not_move_are_named(demo):
    process = demo("--seconds", "1", "--count", "2", "--port", str(find_free_port()))
    output = read_to_end(process)
    assert process.returncode == 1, output
    assert "hero_0 " in output
    assert "hero_1 " in output


def test_an_interrupt_ends_everything_the_monitor_too(demo):
    driver_port = find_free_port()
    process = demo("--count", "2", "--monitor", "--port", str(driver_port))
    line = next(line for line in process.stdout if b"the monitor: " in line)
    monitor_port = int(re.search(rb":(\d+)/", line).group(1))
    wait_until_driver_listens(driver_port)
    wait_for(lambda: listens(monitor_port), "the monitor's page", TIMEOUT_S)
    os.killpg(process.pid, signal.SIGINT)
    output = read_to_end(process)
    assert process.returncode == 130, output
    assert not listens(driver_port), "the driver still listens"
    assert not listens(monitor_port), "the monitor still listens"


def test_closing_the_terminal_ends_everything():
    port = find_free_port()
    process_id, leader = pty.fork()
    if process_id == 0:
        os.execv(str(ROOT / "script" / "demo"), ["demo", "--count", "2", "--no-rviz", "--port", str(port)])
    threading.Thread(target=read_terminal, args=(leader,), daemon=True).start()
    wait_until_driver_listens(port)
    os.kill(process_id, signal.SIGHUP)
    os.close(leader)
    wait_for(lambda: os.waitpid(process_id, os.WNOHANG) != (0, 0), "the end of the demo", TIMEOUT_S)
    assert not listens(port), "the driver still listens"


def read_terminal(leader):
    """Read what the demo draws, so that it never waits for us, until the terminal is closed."""
    try:
        while os.read(leader, 65536):
            pass
    except OSError:
        return


@pytest.mark.parametrize(
    "arguments",
    [
        *(["--seconds", value] for value in ("soon", "inf", "nan", "-1", "9" * 30)),
        *(["--count", value] for value in ("0", "-1", "08", "1e3")),
        *(["--port", value] for value in ("80", "99999")),
        ["--host"],
        ["--fast"],
    ],
)
def test_wrong_arguments_are_refused_in_one_line(demo, arguments):
    process = demo(*arguments)
    output = read_to_end(process)
    assert process.returncode == 2
    assert output.startswith("demo: ")
    assert arguments[0] in output
