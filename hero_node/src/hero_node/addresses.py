"""Internet addresses. Pure."""

import ipaddress


def is_loopback(host: str) -> bool:
    """Return whether only programs on this PC can reach an address, IPv6 also in brackets, or the name localhost."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"
