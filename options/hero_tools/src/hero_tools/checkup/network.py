"""Addresses that robots can connect to, the program on the driver's port, names that resolve.

Read by ip(8) of iproute2 and from /proc: nothing is bound or connected.
"""

import json
import os
import socket
import struct
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


def find_listeners(port: int) -> Dict[str, Optional[int]]:
    """Return the address of each listener on a TCP port, and its process; None: it belongs to another user."""
    sockets = {}
    for table in ("tcp", "tcp6"):
        for line in Path("/proc/net", table).read_text().splitlines()[1:]:
            fields = line.split()
            words, _, own_port = fields[1].partition(":")
            if fields[3] == _LISTENING and int(own_port, 16) == port:
                sockets[f"socket:[{fields[9]}]"] = _decode_address(words)
    owners = _find_owners(set(sockets))
    return {address: owners.get(name) for name, address in sockets.items()}


_LISTENING = "0A"
"""TCP_LISTEN in the tables of proc(5)."""


def _decode_address(words: str) -> str:
    """Return an address that stands in hexadecimal words of this machine's byte order."""
    raw = b"".join(struct.pack("=I", int(words[start : start + 8], 16)) for start in range(0, len(words), 8))
    return socket.inet_ntop(socket.AF_INET if len(raw) == 4 else socket.AF_INET6, raw)


def _find_owners(sockets: Set[str]) -> Dict[str, int]:
    """Return the process that holds each of these sockets, of those that this user may look into."""
    owners = {}
    for link in Path("/proc").glob("[0-9]*/fd/*"):
        try:
            target = os.readlink(str(link))
        except OSError:  # it has ended meanwhile, or belongs to another user
            continue
        if target in sockets:
            owners[target] = int(link.parts[2])
    return owners


def check_port(port: int, listeners: Dict[str, Optional[int]]) -> Finding:
    """Check whether the port is free, held by our driver, or by another program."""
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


def find_source_address(target: str) -> Optional[str]:
    """Return the own address from which packets to target leave."""
    answer = ask_system(["ip", "-j", "route", "get", target])
    return str(json.loads(answer)[0].get("prefsrc") or "") or None if answer else None
