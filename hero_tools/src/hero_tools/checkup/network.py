"""This PC in its network -> addresses that robots can dial, the program on the driver's port, names that resolve.

The listening ports are read from /proc (proc(5)), so that nothing has to be bound or connected to find out.
"""

import ipaddress
import json
import os
import socket
from pathlib import Path
from typing import Dict, List, NamedTuple, Optional, Sequence, Set

from .finding import FAIL, OK, WARN, Finding
from .system_command import NOT_THERE, ask_system

HOTSPOT_ADDRESS = "10.42.0.1"
"""What robots dial that nobody configured, and what NetworkManager gives a PC that shares a hotspot."""

HOST_REMEDY = "roslaunch hero_bringup hero_bringup.launch without host:=, or with host:=0.0.0.0, lets robots in"

EVERYWHERE = {"0.0.0.0", "::"}
LISTENING = "0A"  # TCP_LISTEN in /proc/net/tcp
DRIVER = "hero_driver"
VIRTUAL = ("docker", "veth", "virbr", "br-", "lxc", "tun", "tap", "podman", "vnet")


class Address(NamedTuple):
    """An IPv4 address of this PC."""

    interface: str
    address: str


def read_addresses() -> Optional[List[Address]]:
    """Return this PC's IPv4 addresses without loopback; None where the command ip is missing."""
    answer = ask_system(["ip", "-j", "-4", "address", "show", "up"])
    if answer.code != 0:
        return None
    return [
        Address(link["ifname"], entry["local"])
        for link in json.loads(answer.output or "[]")
        for entry in link.get("addr_info", [])
        if entry.get("family") == "inet" and not ipaddress.ip_address(entry["local"]).is_loopback
    ]


def find_robot_interface(addresses: Sequence[Address], wanted: Optional[str]) -> Optional[str]:
    """Return the interface to the robots' network: as wanted, that of the hotspot, or the only one that is real."""
    if wanted is not None:
        return wanted
    for found in addresses:
        if found.address == HOTSPOT_ADDRESS:
            return found.interface
    real = {found.interface for found in addresses if not found.interface.startswith(VIRTUAL)}
    return real.pop() if len(real) == 1 else None


def is_loopback(address: str) -> bool:
    """Whether an address is one of those that only programs on this PC reach; False for text that is no address."""
    try:
        return ipaddress.ip_address(address.strip("[]")).is_loopback
    except ValueError:
        return False


def check_addresses(
    addresses: Optional[Sequence[Address]], wanted: Optional[str], port: int, listening: Sequence[str]
) -> List[Finding]:
    """Say which addresses robots can be told to dial; listening: where somebody listens on the port already."""
    point = "addresses"
    if addresses is None:
        return [
            Finding(
                point,
                WARN,
                "the command ip is missing, so addresses are not known",
                ["sudo apt install iproute2"],
            )
        ]
    if wanted is not None and wanted not in {found.interface for found in addresses}:
        return [
            Finding(
                point,
                FAIL,
                "interface %s has no IPv4 address" % wanted,
                ["ip -4 address shows which have one"],
            )
        ]
    if listening and not EVERYWHERE & set(listening):
        addresses = [found for found in addresses if found.address in listening]
    if listening and all(map(is_loopback, listening)):
        says = "port %d is open on %s only: simulated robots on this PC reach it, robots in the network do not" % (
            port,
            ", ".join(listening),
        )
        return [Finding(point, WARN, says, [HOST_REMEDY])]
    if not addresses:
        return [
            Finding(
                point,
                WARN,
                "no network: only simulated robots on this PC reach the driver",
                ["rosrun hero_tools hotspot create", "or join the robots' 2.4 GHz network"],
            )
        ]
    listed = ", ".join("%s (%s)" % (found.address, found.interface) for found in addresses)
    if any(found.address == HOTSPOT_ADDRESS for found in addresses):
        return [
            Finding(
                point,
                OK,
                "robots that nobody configured dial %s:%d, which is this PC; all: %s"
                % (HOTSPOT_ADDRESS, port, listed),
            )
        ]
    says = "robots must be told to dial one of these, port %d: %s" % (port, listed)
    remedy = [
        "a robot that nobody configured dials %s: rosrun hero_tools hotspot create gives this PC that address"
        % HOTSPOT_ADDRESS,
        "or set the address on the robot's page (docs/network.md)",
    ]
    return [Finding(point, WARN, says, remedy)]


def find_listeners(port: int, proc: Path = Path("/proc")) -> Dict[str, str]:
    """Return address and socket number of everybody who listens on the TCP port."""
    found = {}
    for name in ("tcp", "tcp6"):
        table = proc / "net" / name
        if not table.is_file():
            continue
        for line in table.read_text().splitlines()[1:]:
            words = line.split()
            local, _, local_port = words[1].rpartition(":")
            if words[3] == LISTENING and int(local_port, 16) == port:
                found[_read_address(local)] = words[9]
    return found


def _read_address(text: str) -> str:
    # Words of 32 bits, each in the byte order of a PC (little endian).
    words = [bytes.fromhex(text[start : start + 8])[::-1] for start in range(0, len(text), 8)]
    return str(ipaddress.ip_address(b"".join(words)))


def find_process(socket_number: str, proc: Path = Path("/proc")) -> Optional[int]:
    """Return the process that holds a socket; None if it belongs to another user."""
    wanted = "socket:[%s]" % socket_number
    for directory in proc.iterdir():
        if not directory.name.isdigit():
            continue
        try:
            if any(os.readlink(link.path) == wanted for link in os.scandir(directory / "fd")):
                return int(directory.name)
        except OSError:  # of another user, or it has ended
            continue
    return None


def check_port(port: int) -> List[Finding]:
    """Say whether the port is free, or our driver listens on it, or who else does."""
    listeners = find_listeners(port)
    if not listeners:
        return [Finding("port", OK, "TCP port %d is free" % port)]
    address, number = next(iter(listeners.items()))
    process = find_process(number)
    if process is None:
        says = "TCP port %d on %s is held by a program of another user" % (port, address)
        return [Finding("port", WARN, says, ["who: sudo ss -ltnp 'sport = :%d'" % port])]
    try:
        words = Path("/proc/%d/cmdline" % process).read_bytes().decode(errors="replace").split("\0")
    except OSError as error:
        words = [str(error)]
    if any(Path(word).name == DRIVER for word in words[:3]):
        return [Finding("port", OK, "the driver listens on %s:%d (process %d)" % (address, port, process))]
    command = "".join(letter if letter.isprintable() else "?" for letter in " ".join(words).strip())[:80]
    says = "TCP port %d on %s is taken by process %d (%s), which is not the driver" % (
        port,
        address,
        process,
        command,
    )
    remedy = [
        "end it: kill %d" % process,
        "or use another port, and set it on the robots too: roslaunch hero_bringup hero_bringup.launch port:=11412",
    ]
    return [Finding("port", FAIL, says, remedy)]


def resolve(name: str) -> Set[str]:
    """Return the IPv4 addresses of a name; empty if it has none. May take seconds: the name server's time limit."""
    try:
        return {
            str(found[4][0]) for found in socket.getaddrinfo(name, None, socket.AF_INET, socket.SOCK_STREAM)
        }
    except (OSError, UnicodeError):
        return set()


def is_own(address: str, own: Sequence[Address]) -> bool:
    """Whether an IPv4 address leads to this PC."""
    return ipaddress.ip_address(address).is_loopback or address in {found.address for found in own}


def find_source_address(target: str) -> Optional[str]:
    """Return the own address from which packets to target leave."""
    answer = ask_system(["ip", "-j", "route", "get", target])
    if answer.code in (0, NOT_THERE) and answer.output:
        return str(json.loads(answer.output)[0].get("prefsrc") or "") or None
    return None
