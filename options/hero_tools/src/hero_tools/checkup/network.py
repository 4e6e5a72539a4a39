"""Addresses that robots can connect to, the program on the driver's port, names that resolve.

Read by ip(8) and ss(8) of iproute2: nothing is bound or connected.
"""

import json
import re
import socket
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional, Sequence, Set

from hero_node import is_loopback

from ..hotspot import ADDRESS
from .points import Finding, ask_system, fail, ok, warn

HOST_REMEDY = "host:=0.0.0.0 admits robots; without host:= the driver does, too, unless count:= is given"

EVERYWHERE = {"0.0.0.0", "::", "*"}
DRIVER = "hero_driver"


class Address(NamedTuple):
    """An IPv4 address of this PC."""

    interface: str
    address: str


def read_addresses() -> Optional[List[Address]]:
    """Return this PC's IPv4 addresses without loopback; None if the command ip is missing."""
    answer = ask_system(["ip", "-j", "-4", "address", "show", "up"])
    if answer is None:
        return None
    return [
        Address(link["ifname"], entry["local"])
        for link in json.loads(answer or "[]")
        for entry in link.get("addr_info", [])
        if entry.get("family") == "inet" and not is_loopback(entry["local"])
    ]


def check_addresses(addresses: Optional[Sequence[Address]], port: int, listening: Sequence[str]) -> Finding:
    """List the addresses that robots can connect to; listening: where a program listens on the port already."""
    if addresses is None:
        return warn("unknown: the command ip is missing", "sudo apt install iproute2")
    if listening and all(map(is_loopback, listening)):
        text = "port %d is open on %s only: simulated robots on this PC reach it, robots in the network do not"
        return warn(text % (port, ", ".join(listening)), HOST_REMEDY)
    if listening and not EVERYWHERE & set(listening):
        addresses = [found for found in addresses if found.address in listening]
    if not addresses:
        return warn(
            "no network: only simulated robots on this PC reach the driver",
            "rosrun hero_tools hotspot create",
            "or join the robots' 2.4 GHz network",
        )
    listed = ", ".join(f"{found.address} ({found.interface})" for found in addresses)
    if any(found.address == ADDRESS for found in addresses):
        text = "robots connect to %s:%d by default, which is this PC; all: %s"
        return ok(text % (ADDRESS, port, listed))
    return warn(
        "robots must be configured to connect to one of these, port %d: %s" % (port, listed),
        f"rosrun hero_tools hotspot create gives this PC the default address, {ADDRESS}",
        "or set the address on the robot's page (docs/network.md)",
    )


def find_listeners(port: int) -> Optional[Dict[str, Optional[int]]]:
    """Return the address of each listener on a TCP port, and its process (None: another user's).

    None if the command ss is missing.
    """
    answer = ask_system(["ss", "-Hltnp", f"sport = :{port}"])
    if answer is None:
        return None
    listeners: Dict[str, Optional[int]] = {}
    for line in answer.splitlines():
        address, process = line.split()[3].rpartition(":")[0], re.search(r"\bpid=(\d+)", line)
        listeners[address.partition("%")[0].strip("[]")] = int(process.group(1)) if process else None
    return listeners


def check_port(port: int, listeners: Optional[Dict[str, Optional[int]]]) -> Finding:
    """Check whether the port is free, held by our driver, or by another program."""
    if listeners is None:
        return warn("unknown: the command ss is missing", "sudo apt install iproute2")
    if not listeners:
        return ok("TCP port %d is free" % port)
    address, process = next(iter(listeners.items()))
    if process is None:
        return warn(
            "TCP port %d on %s is held by a program of another user" % (port, address),
            "to see which: sudo lsof -i tcp:%d -s tcp:listen" % port,
        )
    try:
        words = Path("/proc/%d/cmdline" % process).read_bytes().decode(errors="replace").split("\0")
    except OSError as error:
        words = [str(error)]
    if any(Path(word).name == DRIVER for word in words[:3]):
        return ok("the driver listens on %s:%d (process %d)" % (address, port, process))
    return fail(
        "TCP port %d on %s is taken by process %d (%s), which is not the driver"
        % (port, address, process, " ".join(words).strip()[:80]),
        "end it: kill %d" % process,
        "or use another port, on the robots too: roslaunch hero_bringup hero_bringup.launch port:=11412",
    )


def resolve(name: str) -> Set[str]:
    """Return the IPv4 addresses of a name; empty if it has none. May take seconds: the name server's time limit."""
    try:
        return {str(found[4][0]) for found in socket.getaddrinfo(name, None, socket.AF_INET, socket.SOCK_STREAM)}
    except (OSError, UnicodeError):
        return set()


def is_own(address: str, own: Sequence[Address]) -> bool:
    """Return whether an IPv4 address leads to this PC."""
    return is_loopback(address) or address in {found.address for found in own}
