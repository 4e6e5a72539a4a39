"""Runs the pages of a course: types their commands into terminals and compares the output with the page.

A page is plain Markdown. Its ```console blocks are run:

    $ command            typed into the terminal
    > continuation       further lines of the same command
    ^C                   Ctrl-C is pressed
    anything else        expected output: "..." matches any text within a line, a line "..." any number of lines

A command that is followed by ^C must print its lines first, and is then interrupted; lines after ^C must come last.
A block that starts with output lines shows what a program that was left running prints before it ends by itself.
A comment right before a block holds instructions for the test, separated by ";":

    <!-- tutorial: terminal 2 -->          use this terminal instead of terminal 1
    <!-- tutorial: keeps running -->       the last command is still running when the block ends; a later ^C in this
                                           terminal ends it
    <!-- tutorial: presses w -->           press this key when the lines have been printed
    <!-- tutorial: when COMMAND -->        wait until this command succeeds, e.g. for a program that prints nothing
    <!-- tutorial: fails -->               the last command exits with a status other than 0
    <!-- tutorial: within 60 s -->         time limit for each command; the default is DEADLINE_S
    <!-- tutorial: instead COMMAND -->     type this in place of the block's only command
    <!-- tutorial: not run, REASON -->     skip the block
    <!-- tutorial: file PATH -->           write the block, in any language, to this file

Independent of ROS. The terminals are pseudo terminals running an interactive bash.
"""

import os
import re
import subprocess
import time
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional

import pexpect

DEADLINE_S = 120.0
"""For one command, or for the lines that it must print; generous, because it only ends what has failed."""

ENDING_S = 60.0
"""For the end of a program after Ctrl-C."""

QUIET_S = 0.05
"""Ctrl-C is pressed after this much silence. rospy hangs if the signal arrives while the main thread logs a line: the
signal handler waits for a lock that this thread holds. A test is fast enough to hit that every time."""

PROMPT_PATTERN = re.compile("\x02([0-9]+)\x03")
SHOWN_LINES = 30
"""Of a wrong output, at its beginning and at its end."""
COLUMNS = 400  # so that nothing wraps

UNSHOWN_LINE = re.compile(
    r"\[WARN\] \[[\d.]+\]: (Inbound TCP/IP connection failed|Could not process inbound connection"
    r"|commands are late by [\d.]+ s: |poses are [\d.]+ s old: |waiting for odometry on )"
)
"""Warnings that no page shows: rospy's of a subscriber that connected twice at once, or too late, and those of a busy
PC, whose robots still do what the page shows, if a moment later."""

CONTROL_SEQUENCE = re.compile(r"\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)|\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>]|\x07")


class PageError(Exception):
    """A page cannot be parsed: page, line and cause."""


class TutorialError(Exception):
    """A command did not do what its page shows: page, line, command, expected and actual output."""


class Step(NamedTuple):
    """One action in a terminal: type a command or press Ctrl-C, then wait for lines."""

    line: int
    command: Optional[str]
    """None: press Ctrl-C. Empty: wait for the running program to end."""
    expected: List[str]


class Block(NamedTuple):
    """A fenced block of a page."""

    line: int
    language: str
    text: str
    terminal: int
    keeps_running: bool
    fails: bool
    presses: Optional[str]
    deadline_s: float
    instead: Optional[str]
    when: Optional[str]
    not_run: Optional[str]
    file: Optional[str]

    def read_steps(self, page: Path) -> List[Step]:
        """Return the actions in the terminal. Raises: PageError."""
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


def read_instructions(text: str, where: str) -> Dict[str, object]:
    """Return the instructions of a comment as fields of Block. Raises: PageError for an unknown instruction."""
    instructions: Dict[str, object] = {}
    for instruction in filter(None, (part.strip() for part in text.split(";"))):
        number = re.match(r"terminal (\d+)$", instruction)
        seconds = re.match(r"within (\d+) s$", instruction)
        argument = re.match(r"(presses|instead|when|not run,|file) +(.+)$", instruction, re.DOTALL)
        if number:
            instructions["terminal"] = int(number.group(1))
        elif seconds:
            instructions["deadline_s"] = float(seconds.group(1))
        elif instruction in ("keeps running", "fails"):
            instructions[instruction.replace(" ", "_")] = True
        elif argument:
            instructions[argument.group(1).rstrip(",").replace(" ", "_")] = argument.group(2)
        else:
            raise PageError("%s: unknown instruction '%s'" % (where, instruction))
    return instructions


def read_blocks(page: Path) -> List[Block]:
    """Return the blocks of a page in order. Raises: PageError."""
    blocks = []
    instructions: Dict[str, object] = {}
    lines = page.read_text(encoding="utf-8").splitlines()
    number = 0
    while number < len(lines):
        line = lines[number]
        number += 1
        comment = re.match(r"<!-- tutorial: (.*) -->$", line)
        if comment:
            instructions = read_instructions(comment.group(1), "%s:%d" % (page, number))
        elif line.startswith("```"):
            if "```" not in lines[number:]:
                raise PageError("%s:%d: the block is not closed" % (page, number))
            end = lines.index("```", number)
            text = "".join(inside + "\n" for inside in lines[number:end])
            blocks.append(make_block(number, line[3:].strip(), text, instructions))
            number = end + 1
            instructions = {}
        elif line.strip() and instructions:
            raise PageError("%s:%d: an instruction without a block" % (page, number))
    return blocks


def make_block(line: int, language: str, text: str, instructions: Dict[str, object]) -> Block:
    """Return a block, with defaults for what its instructions do not set."""
    values: Dict[str, object] = {
        "terminal": 1,
        "keeps_running": False,
        "fails": False,
        "presses": None,
        "deadline_s": DEADLINE_S,
        "instead": None,
        "when": None,
        "not_run": None,
        "file": None,
    }
    values.update(instructions)
    return Block(line=line, language=language, text=text, **values)  # type: ignore[arg-type]


def make_pattern(expected: List[str]) -> str:
    """Return a regular expression for the lines, in which "..." matches anything."""
    pattern = ""
    for line in expected:
        if line.strip() == "...":
            pattern += r"(?:[^\n]*\n)*?"
        else:
            # Of four dots the last three are the ellipsis: "0...." is "0." and anything.
            parts = re.split(r"\.\.\.(?!\.)", line.rstrip())
            pattern += "[^\\n]*".join(re.escape(part) for part in parts) + r"\n"
    return pattern


def count_matching(expected: List[str], got: str) -> int:
    """Return how many of the expected lines the output starts with."""
    count = 0
    while count < len(expected) and re.match(make_pattern(expected[: count + 1]), got):
        count += 1
    return count


def clean_output(raw: str) -> str:
    """Return what the terminal shows in the end, without control sequences and overwritten text."""
    lines = CONTROL_SEQUENCE.sub("", raw).replace("\r\n", "\n").split("\n")
    shown = [line.rstrip("\r").rsplit("\r", 1)[-1].rstrip() for line in lines]
    text = "\n".join(line for line in shown if not UNSHOWN_LINE.match(line)).expandtabs(4)
    return text if text.endswith("\n") or not text else text + "\n"


class Terminal:
    """One bash in a pseudo terminal, running at most one command."""

    def __init__(self, environment: Dict[str, str]) -> None:
        """Start it in the home directory of the environment."""
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
        self.exit_code = 0
        self.is_busy = True
        self.wait_for_end(DEADLINE_S)
        # Without job control, which would take a command that something suspends for a moment for one left with Ctrl-Z.
        self.type_line("set +m")
        self.wait_for_end(DEADLINE_S)

    def type_line(self, command: str) -> None:
        """Type a command and press Return."""
        self._raw = ""
        self.is_busy = True
        self._bash.sendline(command)

    def press(self, key: str) -> None:
        """Press a key."""
        self._bash.send(key)

    def interrupt(self) -> bool:
        """Press Ctrl-C in a moment of silence and discard the output; return False if nothing is running."""
        deadline_s = time.monotonic() + ENDING_S
        while self._read(QUIET_S) and time.monotonic() < deadline_s:
            continue
        if self.is_busy:
            self._raw = ""
            self._bash.sendintr()
        return self.is_busy

    @property
    def output(self) -> str:
        """What the command has printed so far."""
        return clean_output(self._raw)

    def _read(self, timeout_s: float) -> bool:
        """Read new output and notice the end of the command; return whether anything was read."""
        try:
            self._raw += self._bash.read_nonblocking(65536, timeout_s)
        except pexpect.TIMEOUT:
            return False
        except pexpect.EOF:
            raise TutorialError("the terminal was closed") from None
        ended = PROMPT_PATTERN.search(self._raw)
        if ended:
            self.is_busy = False
            self.exit_code = int(ended.group(1))
            self._raw = self._raw[: ended.start()]
        return True

    def wait_for_end(self, timeout_s: float) -> bool:
        """Wait for the command to end; return whether it did."""
        deadline_s = time.monotonic() + timeout_s
        while self.is_busy and time.monotonic() < deadline_s:
            self._read(0.2)
        return not self.is_busy

    def wait_for_lines(self, expected: List[str], timeout_s: float) -> bool:
        """Wait until the output starts with these lines; return whether it does while the command is running."""
        deadline_s = time.monotonic() + timeout_s
        while self.is_busy and time.monotonic() < deadline_s:
            self._read(0.2)
            if count_matching(expected, self.output) == len(expected):
                return self.is_busy
        return False

    def close(self) -> None:
        """Interrupt the running command and close the terminal."""
        if self.is_busy:
            self._bash.sendintr()
            self.wait_for_end(ENDING_S)
        self._bash.close(force=True)


class Course:
    """The terminals in which the pages of a course run one after the other, sharing one home directory."""

    def __init__(self, home: Path, changes: Dict[str, str]) -> None:
        """Start without terminals.

        home: an empty directory. changes: replacements for text in console blocks, e.g. the path of an interpreter.
        """
        self._environment = dict(os.environ, HOME=str(home))
        self._changes = changes
        self._terminals: Dict[int, Terminal] = {}

    def run_page(self, page: Path) -> None:
        """Run a page. Raises: PageError, TutorialError."""
        for block in self._read_blocks(page):
            if block.file is not None:
                self._write_file(block)
            elif block.language == "console":
                self._run_block(block, page)

    def _read_blocks(self, page: Path) -> List[Block]:
        """Return the blocks of a page that are to be run or checked, console blocks with the changes."""
        blocks = [block for block in read_blocks(page) if block.not_run is None]
        return [
            block._replace(text=self._change(block.text), instead=self._change(block.instead))
            if block.language == "console"
            else block
            for block in blocks
        ]

    def _write_file(self, block: Block) -> None:
        if block.file is not None:
            path = Path(block.file.replace("~", self._environment["HOME"], 1))
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")

    def _open_terminal(self, number: int) -> Terminal:
        if number not in self._terminals:
            self._terminals[number] = Terminal(self._environment)
        return self._terminals[number]

    def _run_block(self, block: Block, page: Path) -> None:
        terminal = self._open_terminal(block.terminal)
        steps = block.read_steps(page)
        if block.when is not None:
            self._wait_until(block.when, block, page)
        for index, step in enumerate(steps):
            last = index == len(steps) - 1
            if step.command is None:
                self._interrupt(terminal, step, page)
                continue
            if terminal.is_busy != (step.command == ""):
                state = "busy" if terminal.is_busy else "idle"
                raise PageError("%s:%d: terminal %d is %s" % (page, step.line, block.terminal, state))
            if step.command:
                terminal.type_line(step.command)
            if (last and block.keeps_running) or (not last and steps[index + 1].command is None):
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
            time.sleep(0.5)  # most of these commands are programs of ROS, which cost half of that to start
        output = result.stdout.decode(errors="replace")
        raise TutorialError("%s:%d: %s: did not succeed in time:\n%s" % (page, block.line, command, output))

    def _interrupt(self, terminal: Terminal, step: Step, page: Path) -> None:
        if not terminal.is_busy:
            raise PageError("%s:%d: ^C, but nothing is running in this terminal" % (page, step.line))
        ended = terminal.interrupt() and terminal.wait_for_end(ENDING_S)
        if not ended or not re.fullmatch(make_pattern(["...", *step.expected]), terminal.output):
            self._fail(page, step, terminal)

    def _change(self, text: Optional[str]) -> Optional[str]:
        for written, change in self._changes.items():
            text = text and text.replace(written, change)
        return text

    def _fail(self, page: Path, step: Step, terminal: Terminal) -> None:
        """Raises: TutorialError, always."""
        output = terminal.output
        count = count_matching(step.expected, output)
        if step.command is None:
            count = 0
        if count < len(step.expected):
            missing = "%s:%d: %s" % (page.name, step.line + 1 + count, step.expected[count])
        else:
            missing = "no more lines, and the right exit status"
        lines = output.splitlines()
        if len(lines) > 2 * SHOWN_LINES:
            lines[SHOWN_LINES:-SHOWN_LINES] = ["..."]
        state = "still running" if terminal.is_busy else "ended with exit status %d" % terminal.exit_code
        raise TutorialError(
            "%s:%d: $ %s\n  expected: %s\n  got (%s):\n%s"
            % (
                page,
                step.line,
                "^C" if step.command is None else step.command or "(the program that was left running)",
                missing,
                state,
                "".join("    %s\n" % line for line in lines),
            )
        )

    def close(self) -> None:
        """End everything that is running, in reverse order."""
        for terminal in reversed(list(self._terminals.values())):
            terminal.close()
        self._terminals.clear()
