"""Reads Markdown files: their lines, and the commands that they tell people to type."""

import re
import shlex
from pathlib import Path
from typing import List, NamedTuple

import sources

SHELLS = ("console", "bash", "sh", "shell")
FENCE = re.compile(r"^( *)(`{3,}|~{3,}) *(\w*)")
INLINE = re.compile(r"`([^`]+)`")
# What a command of ROS or of ours begins with; other words in backticks are no commands.
BEGINNINGS = re.compile(r"^(roslaunch|rosrun|rostest|rostopic|rosservice|rosmsg|rossrv|(\S*/)?script/\w+|python3 -m)\b")


class Line(NamedTuple):
    """A line of a file and what it is part of: the language of a code block, "indented", or "" for text."""

    number: int
    text: str
    block: str


class Command(NamedTuple):
    """One simple command, split into words as a shell would."""

    path: Path
    line: int
    words: List[str]

    def __str__(self) -> str:
        return "%s:%d: %s" % (self.path.relative_to(sources.ROOT), self.line, " ".join(self.words))


def read_lines(path: Path) -> List[Line]:
    """Return the lines of a file."""
    lines: List[Line] = []
    fence = block = indent = ""
    blank_before = True
    for number, text in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        found = FENCE.match(text)
        if fence:
            if found and found.group(2)[0] == fence[0] and len(found.group(2)) >= len(fence):
                fence = ""
            else:
                lines.append(Line(number, text[len(indent) :] if text.startswith(indent) else text, block))
            continue
        if found:
            indent, fence, block = found.group(1), found.group(2), found.group(3) or "text"
            continue
        was_indented = bool(lines) and lines[-1].block == "indented"
        if text.startswith("    ") and (blank_before or was_indented):
            lines.append(Line(number, text[4:], "indented"))
        else:
            lines.append(Line(number, text, ""))
        blank_before = not text.strip()
    return lines


def read_commands(path: Path) -> List[Command]:
    """Return the commands in blocks for a shell, and those within the text."""
    commands: List[Command] = []
    held, first = "", 0
    for line in read_lines(path):
        if line.block in (*SHELLS, "indented"):
            text = line.text.strip()
            text = text[2:] if text.startswith("$ ") else text
            first = first if held else line.number
            if text.endswith("\\"):
                held += text[:-1] + " "
                continue
            commands += split_commands(path, first, held + text)
            held = ""
        elif not line.block:
            for text in INLINE.findall(line.text):
                if BEGINNINGS.match(text):
                    commands += split_commands(path, line.number, text)
    return commands


def split_commands(path: Path, line: int, text: str) -> List[Command]:
    """Split a line of shell at pipes, && and ;, without what is no simple command."""
    text = text.replace("`", "").replace("\\|", "|")
    lexer = shlex.shlex(text, posix=True, punctuation_chars="|&;()<>")
    lexer.whitespace_split = True
    lexer.commenters = "#"
    commands: List[Command] = []
    words: List[str] = []
    try:
        found = list(lexer)
    except ValueError:  # a quotation that goes on in the next line: a program or a message, not a command
        return []
    for word in [*found, ";"]:
        if word and set(word) <= set("|&;()"):
            commands += [Command(path, line, words)] if words else []
            words = []
        else:
            words.append(word)
    return commands
