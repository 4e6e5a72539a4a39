"""Runs the pages of a course as a newcomer would: types their commands into terminals, compares what comes.

A page is plain Markdown. What is run are its ```console blocks:

    $ command            typed into the terminal
    > more of it         further lines of the same command
    ^C                   Ctrl-C is pressed
    anything else        what the terminal must show: "..." stands for any text within a line, a line "..." for any
                         number of lines

A command that is followed by ^C must show its lines first, and is then interrupted; lines after ^C must come last.
A block that begins with lines shows what a program that was left running has shown when it ends by itself.
A comment right before a block tells what a reader needs not be told, apart by ";":

    <!-- lesson: terminal 2 -->            typed into this terminal; without, into terminal 1
    <!-- lesson: goes on -->               the last command still runs when the block ends; a later ^C in this terminal
                                           ends it
    <!-- lesson: presses w -->             this key is pressed when the lines have come
    <!-- lesson: when COMMAND -->          the test waits until this succeeds: a program that says nothing has come up
    <!-- lesson: fails -->                 the last command ends with an exit code other than 0
    <!-- lesson: within 60 s -->           time for each command; without, DEADLINE_S
    <!-- lesson: instead COMMAND -->       the test types this in place of the block's only command
    <!-- lesson: not run, REASON -->       not typed
    <!-- lesson: file PATH -->             the block, of whatever language, is written to this file
    <!-- lesson: same as FILE -->          the block shows this file of the package, character by character

This module knows nothing of ROS. Terminals are real ones (pseudo terminals with an interactive bash).
"""

import os
import re
import subprocess
import time
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional

import pexpect

DEADLINE_S = 30.0
"""For one command, or for the lines that it must show; generous, because it only ends what has failed."""

ENDING_S = 20.0
"""For the end of a program after Ctrl-C."""

QUIET_S = 0.05
"""Ctrl-C is pressed when nothing has come for so long. If it comes while the main thread logs a line, rospy hangs: its
signal handler waits for a lock that the same thread holds. A test is quick enough to hit that, every time."""

PROMPT_PATTERN = re.compile("\x02([0-9]+)\x03")
COLUMNS = 400  # so that nothing wraps
CONTROL_SEQUENCE = re.compile(r"\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)|\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>]|\x07")


class PageError(Exception):
    """A page is not written as this module reads it: page, line, and what is wrong."""


class LessonError(Exception):
    """A command did not do what its page says: page, line, command, expected, got."""


class Step(NamedTuple):
    """One thing that is done in a terminal: a command is typed, or Ctrl-C pressed, and lines are awaited."""

    line: int
    command: Optional[str]
    """None: Ctrl-C is pressed. Empty: the end of what runs is awaited."""
    expected: List[str]


class Block(NamedTuple):
    """A fenced block of a page."""

    line: int
    language: str
    text: str
    terminal: int
    goes_on: bool
    fails: bool
    presses: Optional[str]
    deadline_s: float
    instead: Optional[str]
    when: Optional[str]
    not_run: Optional[str]
    file: Optional[str]
    same_as: Optional[str]

    def read_steps(self, page: Path) -> List[Step]:
        """Return what is done in the terminal. Raises: PageError."""
        steps: List[Step] = []
        for number, line in enumerate(self.text.splitlines(), self.line + 1):
            if line.startswith("$ "):
                steps.append(Step(number, line[2:], []))
            elif line == "^C":
                steps.append(Step(number, None, []))
            elif not steps:
                steps.append(Step(number - 1, "", [line]))
            elif line.startswith("> ") and not steps[-1].expected and steps[-1].command is not None:
                steps[-1] = steps[-1]._replace(command="%s\n%s" % (steps[-1].command, line[2:]))
            else:
                steps[-1].expected.append(line)
        if self.instead is not None:
            if len(steps) != 1:
                raise PageError("%s:%d: 'instead' needs a block with one command" % (page, self.line))
            steps[0] = steps[0]._replace(command=self.instead)
        return steps


def read_marks(text: str, where: str) -> Dict[str, object]:
    """Return what a comment says as values for Block. Raises: PageError for words that are not known."""
    marks: Dict[str, object] = {}
    for mark in filter(None, (part.strip() for part in text.split(";"))):
        number = re.match(r"terminal (\d+)$", mark)
        seconds = re.match(r"within (\d+) s$", mark)
        argument = re.match(r"(presses|instead|when|not run,|file|same as) +(.+)$", mark, re.DOTALL)
        if number:
            marks["terminal"] = int(number.group(1))
        elif seconds:
            marks["deadline_s"] = float(seconds.group(1))
        elif mark in ("goes on", "fails"):
            marks[mark.replace(" ", "_")] = True
        elif argument:
            marks[argument.group(1).rstrip(",").replace(" ", "_")] = argument.group(2)
        else:
            raise PageError("%s: unknown mark '%s'" % (where, mark))
    return marks


def read_blocks(page: Path) -> List[Block]:
    """Return the blocks of a page in their order. Raises: PageError."""
    blocks = []
    marks: Dict[str, object] = {}
    lines = page.read_text(encoding="utf-8").splitlines()
    number = 0
    while number < len(lines):
        line = lines[number]
        number += 1
        mark = re.match(r"<!-- lesson: (.*) -->$", line)
        if mark:
            marks = read_marks(mark.group(1), "%s:%d" % (page, number))
        elif line.startswith("```"):
            if "```" not in lines[number:]:
                raise PageError("%s:%d: the block has no end" % (page, number))
            end = lines.index("```", number)
            text = "".join(inside + "\n" for inside in lines[number:end])
            blocks.append(make_block(number, line[3:].strip(), text, marks))
            number = end + 1
            marks = {}
        elif line.strip() and marks:
            raise PageError("%s:%d: a mark without a block" % (page, number))
    return blocks


def make_block(line: int, language: str, text: str, marks: Dict[str, object]) -> Block:
    """Return a block with what its marks do not say."""
    values: Dict[str, object] = {
        "terminal": 1,
        "goes_on": False,
        "fails": False,
        "presses": None,
        "deadline_s": DEADLINE_S,
        "instead": None,
        "when": None,
        "not_run": None,
        "file": None,
        "same_as": None,
    }
    values.update(marks)
    return Block(line=line, language=language, text=text, **values)  # type: ignore[arg-type]


def make_pattern(expected: List[str]) -> str:
    """Return the regular expression of lines, "..." standing for anything."""
    pattern = ""
    for line in expected:
        if line.strip() == "...":
            pattern += r"(?:[^\n]*\n)*?"
        else:
            # The last three of four dots are the ellipsis: "0...." is 0. and anything.
            parts = re.split(r"\.\.\.(?!\.)", line.rstrip())
            pattern += "[^\\n]*".join(re.escape(part) for part in parts) + r"\n"
    return pattern


def count_matching(expected: List[str], got: str) -> int:
    """Return how many of the expected lines the output begins with."""
    count = 0
    while count < len(expected) and re.match(make_pattern(expected[: count + 1]), got):
        count += 1
    return count


def clean_output(raw: str) -> str:
    """Return what a terminal shows in the end: no control sequences, of lines that were written over the last text."""
    lines = CONTROL_SEQUENCE.sub("", raw).replace("\r\n", "\n").split("\n")
    shown = [line.rstrip("\r").rsplit("\r", 1)[-1].rstrip() for line in lines]
    text = "\n".join(shown).expandtabs(4)
    return text if text.endswith("\n") or not text else text + "\n"


class Terminal:
    """One bash in a pseudo terminal, with at most one command that runs."""

    def __init__(self, environment: Dict[str, str]) -> None:
        """Open it in the home directory of the environment."""
        environment = dict(environment, PS1="\x02$?\x03", PS2="", HISTFILE="", TERM="dumb")
        environment.pop("PROMPT_COMMAND", None)
        self._bash = pexpect.spawn(
            "bash",
            ["--noprofile", "--norc", "--noediting", "-i"],
            env=environment,
            cwd=environment["HOME"],
            echo=False,
            encoding="utf-8",
            codec_errors="replace",
            dimensions=(50, COLUMNS),
        )
        self._raw = ""
        self.runs = False
        self.exit_code = 0
        self.runs = True
        self.wait_for_end(DEADLINE_S)

    def type_line(self, command: str) -> None:
        """Type a command and Return."""
        self._raw = ""
        self.runs = True
        self._bash.sendline(command)

    def press(self, key: str) -> None:
        """Press a key."""
        self._bash.send(key)

    def interrupt(self) -> bool:
        """Press Ctrl-C in a moment of silence, and forget what was shown; return False if nothing runs any more."""
        deadline_s = time.monotonic() + ENDING_S
        while self._read(QUIET_S) and time.monotonic() < deadline_s:
            continue
        if self.runs:
            self._raw = ""
            self._bash.sendintr()
        return self.runs

    @property
    def output(self) -> str:
        """What the command has shown so far."""
        return clean_output(self._raw)

    def _read(self, timeout_s: float) -> bool:
        """Take in what has come, and see whether the command has ended; return whether anything came."""
        try:
            self._raw += self._bash.read_nonblocking(65536, timeout_s)
        except pexpect.TIMEOUT:
            return False
        except pexpect.EOF:
            raise LessonError("the terminal was closed") from None
        ended = PROMPT_PATTERN.search(self._raw)
        if ended:
            self.runs = False
            self.exit_code = int(ended.group(1))
            self._raw = self._raw[: ended.start()]
        return True

    def wait_for_end(self, timeout_s: float) -> bool:
        """Wait for the end of the command; return whether it came."""
        deadline_s = time.monotonic() + timeout_s
        while self.runs and time.monotonic() < deadline_s:
            self._read(0.2)
        return not self.runs

    def wait_for_lines(self, expected: List[str], timeout_s: float) -> bool:
        """Wait until the output begins with these lines; return whether it does while the command still runs."""
        deadline_s = time.monotonic() + timeout_s
        while self.runs and time.monotonic() < deadline_s:
            self._read(0.2)
            if count_matching(expected, self.output) == len(expected):
                return self.runs
        return False

    def close(self) -> None:
        """Interrupt what runs, and close the terminal."""
        if self.runs:
            self._bash.sendintr()
            self.wait_for_end(ENDING_S)
        self._bash.close(force=True)


class Course:
    """The terminals in which the pages of a course are gone through, one after the other, in one home directory."""

    def __init__(self, home: Path, package: Path, changes: Dict[str, str]) -> None:
        """Begin without terminals.

        home: an empty directory. package: what "same as" looks in. changes: text in a block -> what stands there
        in this run, e.g. the path of an interpreter.
        """
        self._environment = dict(os.environ, HOME=str(home))
        self._package = package
        self._changes = changes
        self._terminals: Dict[int, Terminal] = {}

    def run_page(self, page: Path) -> None:
        """Do what the page says. Raises: PageError, LessonError."""
        for block in read_blocks(page):
            check_same_as(block, page, self._package)
            if block.language == "console":
                block = block._replace(text=self._change(block.text), instead=self._change(block.instead))
            if block.not_run is not None:
                continue
            if block.file is not None:
                path = Path(block.file.replace("~", self._environment["HOME"], 1))
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(block.text, encoding="utf-8")
            elif block.language == "console":
                self._run_block(block, page)

    def _run_block(self, block: Block, page: Path) -> None:
        if block.terminal not in self._terminals:
            self._terminals[block.terminal] = Terminal(self._environment)
        terminal = self._terminals[block.terminal]
        steps = block.read_steps(page)
        if block.when is not None:
            self._wait_until(block.when, block, page)
        for index, step in enumerate(steps):
            last = index == len(steps) - 1
            if step.command is None:
                self._interrupt(terminal, step, page)
                continue
            if terminal.runs != (step.command == ""):
                state = "busy" if terminal.runs else "idle"
                raise PageError("%s:%d: terminal %d is %s" % (page, step.line, block.terminal, state))
            if step.command:
                terminal.type_line(step.command)
            if (last and block.goes_on) or (not last and steps[index + 1].command is None):
                if not terminal.wait_for_lines(step.expected, block.deadline_s):
                    self._fail(page, step, terminal)
                if last and block.presses:
                    terminal.press(block.presses)
                continue
            ended = terminal.wait_for_end(block.deadline_s)
            matches = re.fullmatch(make_pattern(step.expected or ["..."]), terminal.output)
            if not ended or not matches or (terminal.exit_code != 0) != (last and block.fails):
                self._fail(page, step, terminal)

    def _wait_until(self, command: str, block: Block, page: Path) -> None:
        deadline_s = time.monotonic() + block.deadline_s
        while time.monotonic() < deadline_s:
            result = subprocess.run(
                ["bash", "-c", command],
                env=self._environment,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                check=False,
            )
            if result.returncode == 0:
                return
            time.sleep(0.1)
        output = result.stdout.decode(errors="replace")
        raise LessonError("%s:%d: %s: did not succeed in time:\n%s" % (page, block.line, command, output))

    def _interrupt(self, terminal: Terminal, step: Step, page: Path) -> None:
        if not terminal.runs:
            raise PageError("%s:%d: ^C, but nothing runs in this terminal" % (page, step.line))
        ended = terminal.interrupt() and terminal.wait_for_end(ENDING_S)
        if not ended or not re.fullmatch(make_pattern(["...", *step.expected]), terminal.output):
            self._fail(page, step, terminal)

    def _change(self, text: Optional[str]) -> Optional[str]:
        for written, change in self._changes.items():
            text = text and text.replace(written, change)
        return text

    def _fail(self, page: Path, step: Step, terminal: Terminal) -> None:
        """Raises: LessonError with all that is known."""
        output = terminal.output
        count = count_matching(step.expected, output)
        if step.command is None:
            count = 0
        if count < len(step.expected):
            missing = "%s:%d: %s" % (page.name, step.line + 1 + count, step.expected[count])
        else:
            missing = "no more lines, and the end of the command with the right exit code"
        state = "it still runs" if terminal.runs else "it ended with exit code %d" % terminal.exit_code
        raise LessonError(
            "%s:%d: $ %s\n  expected: %s\n  got (%s):\n%s"
            % (
                page,
                step.line,
                "^C" if step.command is None else step.command or "(what was left running)",
                missing,
                state,
                "".join("    %s\n" % line for line in output.splitlines()[-60:]),
            )
        )

    def close(self) -> None:
        """End everything that runs, last opened first."""
        for terminal in reversed(list(self._terminals.values())):
            terminal.close()
        self._terminals.clear()


def check_same_as(block: Block, page: Path, package: Path) -> None:
    """Raises: LessonError if the block does not show the file that it says it shows."""
    if block.same_as is None:
        return
    if block.text != (package / block.same_as).read_text(encoding="utf-8"):
        raise LessonError("%s:%d: the block differs from %s" % (page, block.line, package / block.same_as))
