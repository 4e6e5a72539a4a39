"""Internet addresses."""

import ipaddress
import socket


def is_loopback(host: str) -> bool:
    """Return whether only programs on this PC can reach an address, IPv6 also in brackets, or the name localhost."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def find_source_address(target: str) -> str:
    """Return this PC's address from which packets to an IPv4 address leave; empty without a route. Sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((target, 9))
        except OSError:
            return ""
        return str(probe.getsockname()[0])
