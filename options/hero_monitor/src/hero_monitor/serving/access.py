"""Decides by headers and token who may see the page. Pure. Sessions are signed cookies (server).

Three threats: a client on the network without the token; a page of another server in the same browser that opens a
WebSocket to this one (browsers allow that, RFC 6455 section 10.2: the server must check Origin); and a foreign name
that resolves to this PC (DNS rebinding: the server must check Host).
"""

import hmac
import ipaddress
from typing import FrozenSet, Iterable, Optional

from .lesson import TEACHER, Lesson, User

TOKEN_KEY = "token"
TOKEN_LENGTH_MIN = 16
"""A shorter token could be guessed."""


class Access:
    """The rules of one server."""

    def __init__(self, token: Optional[str], host_names: Iterable[str], lesson: Optional[Lesson] = None) -> None:
        """token: None if none is needed; host_names: names of this PC; lesson: its codes are valid, too."""
        self._token = token
        self.lesson = lesson
        self._host_names: FrozenSet[str] = frozenset(name.lower().rstrip(".") for name in host_names)

    def admits_host(self, name: str) -> bool:
        """Return whether a Host header's name, without port, is this PC's; any address is: rebinding needs a name."""
        name = name.lower().rstrip(".")
        if name == "localhost" or name in self._host_names:
            return True
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True

    @staticmethod
    def admits_origin(origin: Optional[str], host_header: str) -> bool:
        """Return whether a request comes from a page of this server; without Origin it does not."""
        if not origin:
            return False
        scheme, _, netloc = origin.partition("://")
        return scheme in ("http", "https") and netloc.lower() == host_header.lower()

    def find_key(self, secret: str) -> str:
        """Return what the cookie of a user holds who gives this secret; empty if it is wrong."""
        # JSON may hold halves of surrogate pairs, which strict UTF-8 refuses.
        given = secret.encode("utf-8", "surrogatepass")
        if self._token is not None and hmac.compare_digest(given, self._token.encode("utf-8")):
            return TOKEN_KEY
        is_code = self.lesson is not None and self.lesson.find(secret) is not None
        return secret.replace(" ", "") if is_code else ""

    def find_user(self, cookie: Optional[str]) -> Optional[User]:
        """Return whose cookie this is: a key and a name; None for none of this server, or a code that was withdrawn."""
        if self._token is None:
            return User("", TEACHER)
        key, _, name = (cookie or "").partition(" ")
        role = TEACHER if key == TOKEN_KEY else self.lesson.find(key) if self.lesson else None
        return None if role is None else User(name, role)
