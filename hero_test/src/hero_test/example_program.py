"""An example program as a process of its own, as a user starts it, and what it wrote."""

import signal
import subprocess
import tempfile

from hero_test.swarm_watch import wait_for

END_TIMEOUT_S = 20.0


def find_program(name):
    """Return the path of a node of hero_examples."""
    found = subprocess.check_output(["catkin_find", "--first-only", "--libexec", "hero_examples", name])
    return found.decode().strip()


class ExampleProgram:
    """A node of hero_examples under a node name of its own, so that no parameter of another run counts for it."""

    count = 0

    def __init__(self, name, *arguments, environment=None):
        ExampleProgram.count += 1
        self.name = name
        self.output = tempfile.NamedTemporaryFile()  # noqa: SIM115 - closed with the program
        self.process = subprocess.Popen(
            [find_program(name), "__name:=%s_%d" % (name, ExampleProgram.count), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=self.output,
            stderr=subprocess.STDOUT,
            env=environment,
            start_new_session=True,
        )

    def text(self):
        """Return all that it wrote so far."""
        with open(self.output.name, encoding="utf-8") as written:  # a file of its own: seeking would move the program's
            return written.read()

    def wait_for_text(self, text, timeout_s=END_TIMEOUT_S):
        wait_for(
            lambda: text in self.text(),
            timeout_s,
            lambda: "%r from %s, which wrote %s" % (text, self.name, self.text()),
        )

    def wait(self, timeout_s=END_TIMEOUT_S):
        """Wait until it has ended by itself; return its exit code."""
        return self.process.wait(timeout_s)

    def end(self, number=signal.SIGINT):
        """Send a signal, wait for the end and return the exit code; safe when it has ended."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        return self.wait()

    def close(self):
        """End it whatever state it is in."""
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.output.close()
