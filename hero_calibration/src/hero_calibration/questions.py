"""Questions to the user in the terminal."""

import sys

from hero_node.command_line import say
from hero_node.ros.program import Program

from .errors import CalibrationError, EndedError

NO_TERMINAL = "no terminal to answer questions: start it in a terminal, or with --yes"


def ask(program: Program, question: str) -> str:
    """Ask the user; return the answer in lower case.

    Raises: EndedError if the program is to end meanwhile, CalibrationError without a terminal.
    """
    if sys.stdin is None:
        raise CalibrationError(NO_TERMINAL)
    say(question, end="")
    # input() would keep waiting after Ctrl-C: signals only set a flag here.
    while not program.wait_readable([sys.stdin.fileno()], 1.0):
        if not program.running:
            say("")
            raise EndedError
    try:
        answer = sys.stdin.readline()
    except UnicodeDecodeError:
        return ""  # a key that is no letter, as Enter
    if not answer:
        raise CalibrationError(NO_TERMINAL)
    return answer.strip().lower()
