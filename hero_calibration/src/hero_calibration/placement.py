"""Asks the user to place the robots, and checks their places by their raw infrared readings."""

import sys
from typing import Dict

from hero_client.command_line import say
from hero_client.program import Program

from .errors import CalibrationError, EndedError
from .infrared_model import find_obstacle
from .probe import Probe
from .session import Session

READY_TIMEOUT_S = 10.0
SCANS_TO_CHECK = 5

ROOM = "Place the robots on the floor with 20 cm of room around each: they will turn on the spot."
WALL = (
    "Place each robot with its front facing a flat white wall, 10 cm between wall and body, 40 cm between "
    "robots: they will turn on the spot, twice."
)
NOBODY = "nobody is there to answer: start it in a terminal, or with --yes"


def place_robots(session: Session, at_wall: bool, ask_nothing: bool) -> None:
    """Let the user place the robots, and check their places; badly placed robots fail.

    Raises: EndedError if the user ends the program, CalibrationError where nobody can answer.
    """
    question = "Enter when they are placed, q to end: "
    if not ask_nothing:
        say("\n" + (WALL if at_wall else ROOM))
    while True:
        answer = "" if ask_nothing else ask(session.program, question)
        if answer == "q":
            raise EndedError
        problems = check_places(session, at_wall)
        for probe, reason in problems.items():
            say("%s: %s" % (probe.name, reason))
        if ask_nothing or answer == "s" or not problems:
            break
        question = "Enter to check again after correcting that, s to go on without these, q to end: "
    for probe, reason in problems.items():
        probe.failure = "place: " + reason


def check_places(session: Session, at_wall: bool) -> Dict[Probe, str]:
    """Return the robots that are silent or badly placed, each with the reason."""
    probes = session.active
    for probe in probes:
        probe.forget_scans()
    session.wait_for(
        lambda: all(probe.count_scans() >= SCANS_TO_CHECK and not probe.find_silence() for probe in probes),
        READY_TIMEOUT_S,
    )
    problems = {}
    for probe in probes:
        try:
            probe.check_alive()
            obstacle = find_obstacle(probe.read_scans()[0], at_wall)
        except CalibrationError as error:
            obstacle = str(error)
        if obstacle is not None:
            problems[probe] = obstacle
    return problems


def ask(program: Program, question: str) -> str:
    """Ask the user; return the answer in lower case.

    Raises: EndedError if the program is to end meanwhile, CalibrationError where nobody can answer.
    """
    if sys.stdin is None:
        raise CalibrationError(NOBODY)
    say(question, end="")
    # input() would go on waiting after Ctrl-C: signals only set a flag here.
    while not program.wait_readable([sys.stdin.fileno()], 1.0):
        if not program.running:
            say("")
            raise EndedError
    try:
        answer = sys.stdin.readline()
    except UnicodeDecodeError:
        return ""  # a key that is no letter, as Enter
    if not answer:
        raise CalibrationError(NOBODY)
    return answer.strip().lower()
