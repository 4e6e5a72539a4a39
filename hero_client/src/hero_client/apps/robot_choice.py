"""Which robots of a swarm a joystick drives: all, one, or some, chosen by buttons and shown by their lights. Pure."""

from typing import Any, List, NamedTuple, Sequence, Set

CHOSEN_COLOR = "white"
FORMATION_COLOR = "cyan"


class ChoiceButtons(NamedTuple):
    """Indices of buttons; those that a joystick lacks are never pressed."""

    next_button: int = 5
    """Chooses the next robot; after the last one the first."""
    keep_button: int = 2
    """Keeps the chosen robot, beside those that are chosen next."""
    all_button: int = 3
    """Chooses all robots again."""
    formation_button: int = 0
    """Drives the chosen robots as they stand, as one body; pressed again, or after another choice, each by itself."""


class RobotChoice:
    """The chosen robots of a swarm: at first all.

    Attributes:
        is_formation: whether they are to be driven as one body.
    """

    def __init__(self, robots: Sequence[Any], buttons: ChoiceButtons) -> None:
        self._robots = list(robots)
        self._buttons = buttons
        self._held: Set[int] = set()
        self._current = -1  # of no robot: all are chosen
        self._kept: Set[int] = set()
        self.is_formation = False

    @property
    def robots(self) -> List[Any]:
        """Those that are chosen, in the order of the swarm."""
        if self._current < 0:
            return self._robots
        return [robot for index, robot in enumerate(self._robots) if index == self._current or index in self._kept]

    def read(self, buttons: Sequence[int]) -> List[Any]:
        """Take the buttons of a message; return the robots that are no longer chosen."""
        held = {index for index in self._buttons if index < len(buttons) and buttons[index]}
        pressed, self._held = held - self._held, held
        before, was_formation = self.robots, self.is_formation
        self.is_formation = False
        if self._buttons.formation_button in pressed and len(before) > 1:
            self.is_formation = not was_formation
        elif self._buttons.all_button in pressed:
            self._current = -1
            self._kept.clear()
        elif self._buttons.keep_button in pressed and self._current >= 0:
            self._kept.add(self._current)
        elif self._buttons.next_button in pressed:
            self._current = (self._current + 1) % len(self._robots)
        else:
            self.is_formation = was_formation
            return []
        chosen = self.robots
        color = FORMATION_COLOR if self.is_formation else CHOSEN_COLOR if self._current >= 0 else "off"
        for robot in self._robots:
            robot.led(color if robot in chosen else "off")
        return [robot for robot in before if robot not in chosen]
