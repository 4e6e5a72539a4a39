"""Asks the user to place the robots, and checks their places by their raw infrared readings."""

from typing import Callable, Dict, Optional

from hero_node import say

from ..errors import CalibrationError, EndedError
from ..models.infrared_model import find_obstacle
from ..robots.probe import Probe
from ..robots.session import Session

READY_TIMEOUT_S = 10.0
SCANS_TO_CHECK = 5

ROOM = (
    "Place the robots on the floor with 20 cm of room around each, 40 cm between robots: they will turn on the spot, "
    "move up to 13 cm meanwhile, and be stopped if they move more than 15 cm."
)
WALL = (
    "Place each robot with its front facing a flat white wall, 10 cm between wall and body, 40 cm between "
    "robots: they will turn on the spot, twice."
)

Ask = Callable[[str], str]
"""Asks the user a question; returns the answer in lower case."""


def place_robots(session: Session, at_wall: bool, ask: Optional[Ask]) -> None:
    """Ask the user to place the robots, and check their places; badly placed robots fail.

    ask: None if they are placed already. Raises: EndedError if the user ends the program, and what ask raises.
    """
    question = "Enter when they are placed, q to end: "
    if ask is not None:
        say("\n" + (WALL if at_wall else ROOM))
    while True:
        answer = "" if ask is None else ask(question)
        if answer == "q":
            raise EndedError
        problems = check_places(session, at_wall)
        for probe, reason in problems.items():
            say(f"{probe.name}: {reason}")
        if ask is None or answer == "s" or not problems:
            break
        question = "Enter to check again after correcting that, s to continue without these, q to end: "
    for probe, reason in problems.items():
        probe.failure = "place: " + reason


def check_places(session: Session, at_wall: bool) -> Dict[Probe, str]:
    """Return the robots that are silent or badly placed, each with the reason."""
    probes = session.active
    for probe in probes:
        probe.forget_scans()

    def is_ready(probe: Probe) -> bool:
        return probe.count_scans() >= SCANS_TO_CHECK and not probe.find_silence(session.now_s)

    session.wait_for(lambda: all(map(is_ready, probes)), READY_TIMEOUT_S)
    problems = {}
    for probe in probes:
        try:
            probe.check_alive(session.now_s)
            obstacle = find_obstacle(probe.read_scans()[0].tolist(), at_wall)
        except CalibrationError as error:
            obstacle = str(error)
        if obstacle is not None:
            problems[probe] = obstacle
    return problems
