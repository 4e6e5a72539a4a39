"""Which robots of a swarm a joystick drives: all, one, or some, chosen by buttons and shown by their lights. Pure."""

from typing import Any, List, NamedTuple, Sequence, Set

__all__ = ["ChoiceButtons", "RobotChoice"]

CHOSEN_COLOR = "white"


class ChoiceButtons(NamedTuple):
    """Indices of buttons; those that a joystick lacks are never pressed."""

    next_button: int = 5
    """Chooses the next robot; after the last one the first."""
    keep_button: int = 2
    """Keeps the chosen robot, beside those that are chosen next."""
    all_button: int = 3
    """Chooses all robots again."""


class RobotChoice:
    """The chosen robots of a swarm: at first all."""

    def __init__(self, robots: Sequence[Any], buttons: ChoiceButtons) -> None:
        self._robots = list(robots)
        self._buttons = buttons
        self._held: Set[int] = set()
        self._current = -1  # of no robot: all are chosen
        self._kept: Set[int] = set()

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
        before = self.robots
        if self._buttons.all_button in pressed:
            self._current = -1
            self._kept.clear()
        elif self._buttons.keep_button in pressed and self._current >= 0:
            self._kept.add(self._current)
        elif self._buttons.next_button in pressed:
            self._current = (self._current + 1) % len(self._robots)
        else:
            return []
        chosen = self.robots
        for robot in self._robots:
            robot.led(CHOSEN_COLOR if self._current >= 0 and robot in chosen else "off")
        return [robot for robot in before if robot not in chosen]
