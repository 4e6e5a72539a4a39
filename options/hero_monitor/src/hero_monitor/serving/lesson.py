"""Roles of users, and the six-digit codes of a lesson that give them. Pure.

Who has the token, or needs none, is a teacher and may do all. A viewer watches and stops; a driver also drives some
robots. Stops are open to all users: a role never takes one away.
"""

import secrets
from typing import Any, Dict, FrozenSet, List, NamedTuple, Optional, Sequence

CODES_MAX = 200

FOR_DRIVERS = ("drive", "goal", "start", "end")
"""Requests that drivers may make for their own robots."""

FOR_ALL = ("show", "stop", "stop_some", "end_drive")


class Role(NamedTuple):
    """Rights of a user."""

    title: str
    robots: FrozenSet[str] = frozenset()
    """Robots that a driver may drive, by name."""

    def find_refusal(self, do: str, robots: Sequence[str]) -> str:
        """Return why this role may not make a request for these robots; empty if it may."""
        if self == TEACHER or do in FOR_ALL:
            return ""
        if self == VIEWER or do not in FOR_DRIVERS:
            return f"a {self.title} may not do that: ask the teacher"
        if robots and self.robots.issuperset(robots):
            return ""
        return f"you are the driver of {', '.join(sorted(self.robots))}: ask the teacher for the code of others"


TEACHER, VIEWER = Role("teacher"), Role("viewer")


class User(NamedTuple):
    """User of a page, as given at the login."""

    name: str
    role: Role

    def describe(self, place: str) -> str:
        """Return name and role for the log; place: where the user is, such as an address."""
        role = self.role.title + (f" of {', '.join(sorted(self.role.robots))}" if self.role.robots else "")
        return f"{self.name} ({role}), {place}" if self.name else f"a {role}, {place}"


class Lesson:
    """The codes that are valid until the monitor ends, or a teacher withdraws them."""

    def __init__(self) -> None:
        self._roles: Dict[str, Role] = {}
        self.class_code = self.add(())

    def add(self, robots: Sequence[str]) -> str:
        """Return a code for the drivers of these robots; without robots, for viewers."""
        role = Role("driver", frozenset(robots)) if robots else VIEWER
        code = next((code for code, known in self._roles.items() if known == role), "")
        while not code or (code in self._roles and self._roles[code] != role):
            code = "%06d" % secrets.randbelow(10**6)
        if len(self._roles) < CODES_MAX:
            self._roles[code] = role
        return code

    def withdraw(self, code: str) -> None:
        """End driving by this code; the class code stays."""
        if code != self.class_code:
            self._roles.pop(code, None)

    def find(self, code: str) -> Optional[Role]:
        """Return the role that a code gives."""
        return self._roles.get(code.replace(" ", ""))

    def list_drivers(self) -> List[List[Any]]:
        """Return the codes for drivers, each with its robots."""
        return [[code, sorted(role.robots)] for code, role in self._roles.items() if role.robots]
