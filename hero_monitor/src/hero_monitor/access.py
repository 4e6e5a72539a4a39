"""Who may see the page: decides by headers and tokens. Pure. Sessions are signed cookies (server).

Three dangers: somebody on the network who does not know the token; a web page of somebody else, open in the same
browser, that opens a WebSocket to this server (browsers allow that, RFC 6455 section 10.2: the server must look at
Origin); and a foreign name that is made to resolve to this machine (DNS rebinding: the server must look at Host).
"""

import hmac
import ipaddress
from typing import FrozenSet, Iterable, Optional, Tuple
from urllib.parse import urlsplit

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
    """The rules of one server."""

    def __init__(self, token: Optional[str], host_names: Iterable[str]) -> None:
        """token: None where none is needed; host_names: names by which this machine may be called."""
        self._token = token
        self._host_names: FrozenSet[str] = frozenset(name.lower().rstrip(".") for name in host_names)

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

    def admits_token(self, token: str) -> bool:
        """Return whether this is the token."""
        if self._token is None:
            return False
        # JSON may hold halves of surrogate pairs, which strict UTF-8 refuses.
        return hmac.compare_digest(token.encode("utf-8", "surrogatepass"), self._token.encode("utf-8"))
