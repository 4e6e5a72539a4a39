"""Who may see the page: headers, tokens and cookies -> yes or no. Pure; time enters as now_s.

Three dangers: somebody on the network who does not know the token; a web page of somebody else, open in the same
browser, that opens a WebSocket to this server (browsers allow that, RFC 6455 section 10.2: the server must look at
Origin); and a foreign name that is made to resolve to this machine (DNS rebinding: the server must look at Host).
"""

import hmac
import ipaddress
import secrets
from typing import Dict, FrozenSet, Iterable, Optional, Tuple
from urllib.parse import urlsplit

SESSION_S = 12 * 3600.0
"""How long a browser that gave the token is let in."""

SESSIONS_MAX = 200
"""Browsers that are let in at once; the oldest is forgotten."""

TOKEN_LENGTH_MIN = 16
"""Short of this a token can be guessed."""


def is_loopback(host: str) -> bool:
    """Return whether an address to bind to is reached from this machine alone."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def split_host(header: str) -> Optional[Tuple[str, int]]:
    """Return host (without brackets, lower case) and port of a Host header, None if it is none."""
    try:
        parts = urlsplit("//" + header)
        if parts.hostname is None or parts.path or parts.query or parts.fragment or "@" in parts.netloc:
            return None
        return parts.hostname.rstrip("."), parts.port or 80
    except ValueError:
        return None


class Access:
    """The rules of one server, and the browsers that gave its token."""

    def __init__(self, token: Optional[str], host_names: Iterable[str]) -> None:
        """token: None where none is needed; host_names: names by which this machine may be called."""
        self._token = token
        self._host_names: FrozenSet[str] = frozenset(name.lower().rstrip(".") for name in host_names)
        self._sessions: Dict[str, float] = {}

    @property
    def needs_token(self) -> bool:
        """Whether a browser has to give a token."""
        return self._token is not None

    def admits_host(self, header: str) -> bool:
        """Return whether a Host header names this machine.

        An address is always right: to rebind a name one needs a name.
        """
        host = split_host(header)
        if host is None:
            return False
        if host[0] == "localhost" or host[0] in self._host_names:
            return True
        try:
            ipaddress.ip_address(host[0])
        except ValueError:
            return False
        return True

    @staticmethod
    def admits_origin(origin: Optional[str], host_header: str) -> bool:
        """Return whether the page that asks came from this very server. No Origin: no."""
        if not origin:
            return False
        scheme, _, netloc = origin.partition("://")
        return scheme in ("http", "https") and netloc.lower() == host_header.lower()

    def log_in(self, token: str, now_s: float) -> Optional[str]:
        """Return the secret of a new session, None if the token is wrong."""
        if self._token is None or not hmac.compare_digest(token.encode("utf-8"), self._token.encode("utf-8")):
            return None
        while len(self._sessions) >= SESSIONS_MAX:
            del self._sessions[min(self._sessions, key=lambda known: self._sessions[known])]
        session = secrets.token_urlsafe(32)
        self._sessions[session] = now_s + SESSION_S
        return session

    def admits_session(self, session: Optional[str], now_s: float) -> bool:
        """Return whether a cookie is one that log_in gave out, and not too old."""
        if self._token is None:
            return True
        found = False
        for known, end_s in self._sessions.items():
            found |= hmac.compare_digest(known.encode(), (session or "").encode("utf-8")) and now_s < end_s
        return found
