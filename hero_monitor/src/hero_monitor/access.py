"""Decides by headers and token who may see the page. Pure. Sessions are signed cookies (server).

Three threats: a client on the network without the token; a page of another server in the same browser that opens a
WebSocket to this one (browsers allow that, RFC 6455 section 10.2: the server must check Origin); and a foreign name
that resolves to this PC (DNS rebinding: the server must check Host).
"""

import hmac
import ipaddress
from typing import FrozenSet, Iterable, Optional, Tuple
from urllib.parse import urlsplit

TOKEN_LENGTH_MIN = 16
"""A shorter token could be guessed."""


def is_loopback(host: str) -> bool:
    """Return whether an address to bind to can be reached from this PC only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def split_host(header: str) -> Optional[Tuple[str, int]]:
    """Return host (without brackets, lower case) and port of a Host header; None if it is invalid."""
    try:
        parts = urlsplit("//" + header)
        if parts.hostname is None or parts.path or parts.query or parts.fragment or "@" in parts.netloc:
            return None
        return parts.hostname.rstrip("."), parts.port or 80
    except ValueError:
        return None


class Access:
    """The rules of one server."""

    def __init__(self, token: Optional[str], host_names: Iterable[str]) -> None:
        """token: None if none is needed; host_names: names of this PC."""
        self._token = token
        self._host_names: FrozenSet[str] = frozenset(name.lower().rstrip(".") for name in host_names)

    @property
    def needs_token(self) -> bool:
        """Whether a browser has to give a token."""
        return self._token is not None

    def admits_host(self, header: str) -> bool:
        """Return whether a Host header names this PC; any address does, because DNS rebinding needs a name."""
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
        """Return whether a request comes from a page of this server; without Origin it does not."""
        if not origin:
            return False
        scheme, _, netloc = origin.partition("://")
        return scheme in ("http", "https") and netloc.lower() == host_header.lower()

    def admits_token(self, token: str) -> bool:
        """Return whether this is the token."""
        if self._token is None:
            return False
        # JSON may hold halves of surrogate pairs, which strict UTF-8 refuses.
        return hmac.compare_digest(token.encode("utf-8", "surrogatepass"), self._token.encode("utf-8"))
