"""The end of a started program: first asked, at last by force."""

import signal
from subprocess import TimeoutExpired

from hero_node.processes import TERM_TIMEOUT_S, end_process


class Process:
    """A program that ends at one signal only."""

    def __init__(self, ends_at):
        self.ends_at, self.calls = ends_at, []

    def send_signal(self, number):
        self.calls.append(number)

    def kill(self):
        self.calls.append(signal.SIGKILL)

    def wait(self, timeout=None):
        self.calls.append(timeout)
        if self.ends_at not in self.calls:
            raise TimeoutExpired("program", timeout)
        return 7


def test_a_program_is_asked_to_end_then_told_then_killed():
    calls = [signal.SIGINT, 5.0, signal.SIGTERM, TERM_TIMEOUT_S, signal.SIGKILL, None]
    for count, number in ((2, signal.SIGINT), (4, signal.SIGTERM), (6, signal.SIGKILL)):
        process = Process(number)
        assert end_process(process, 5.0) == 7
        assert process.calls == calls[:count]
