"""A Wi-Fi device of this PC -> the access point that robots join.

    rosrun hero_tools hotspot create     asks for a password; --dry-run prints the commands instead
    rosrun hero_tools hotspot show
    rosrun hero_tools hotspot stop

Needs no ROS. What it makes is a connection of NetworkManager called hero_hotspot.
"""

import argparse
import getpass
import shlex
import subprocess
import sys
from typing import List, Optional, Sequence

from hero_client import command_line

from . import nmcli
from .nmcli import NetworkManagerError, NmcliCall, WifiDevice

FACTORY_SSID = "hero_network"
FACTORY_PASSWORD = "s3cr3tp4ss"  # printed in the robots' documentation: known to all
DRIVER_PORT = 11411
SSID_BYTES_MAX = 32  # IEEE 802.11
PASSWORD_LENGTHS = (8, 63)  # a WPA2 passphrase


class HotspotError(Exception):
    """The hotspot cannot be made as asked; the text is one line with the remedy."""


def read_password(options: argparse.Namespace) -> str:
    """Return the password, from where the options say or from the person at the terminal.

    Raises: HotspotError.
    """
    if options.factory:
        return FACTORY_PASSWORD
    try:
        if options.password_stdin:
            return check_password(sys.stdin.readline().rstrip("\n"))
        if not sys.stdin.isatty():
            raise HotspotError(
                "no terminal to ask for the password: --password-stdin reads it from standard input"
            )
        password = check_password(getpass.getpass("password of the new network (8 to 63 characters): "))
        if getpass.getpass("once more: ") != password:
            raise HotspotError("the two passwords differ: start again")
    except UnicodeDecodeError:
        raise HotspotError("the password is not text: choose letters, digits and signs of ASCII") from None
    return password


def check_password(password: str) -> str:
    """Return the password if WPA2 and the robots' page take it.

    Raises: HotspotError, which does not hold the password.
    """
    low, high = PASSWORD_LENGTHS
    if not low <= len(password) <= high:
        raise HotspotError(
            "the password has %d characters, but WPA2 needs %d to %d" % (len(password), low, high)
        )
    if not all(" " <= letter <= "~" for letter in password):
        raise HotspotError(
            "the password holds a letter outside ASCII, which WPA2 does not define: choose another"
        )
    if password != password.strip():
        raise HotspotError(
            "the password begins or ends with a space, which is lost on the way: choose another"
        )
    return password


def check_ssid(ssid: str) -> str:
    """Return the name of the network if it may be one.

    Raises: HotspotError.
    """
    if not ssid.isprintable() or not 1 <= len(ssid.encode()) <= SSID_BYTES_MAX:
        raise HotspotError(
            "--ssid %s: must be 1 to %d bytes of printable text" % (ascii(ssid), SSID_BYTES_MAX)
        )
    return ssid


def choose_device(devices: Sequence[WifiDevice], wanted: Optional[str], ask: bool) -> WifiDevice:
    """Return the device to use: the one wanted, the only one, or the one that the person chooses.

    Raises: HotspotError.
    """
    if not devices:
        raise HotspotError(
            "no Wi-Fi device: is one plugged in, its driver loaded (nmcli device), its radio on (rfkill list)?"
        )
    names = ", ".join(device.name for device in devices)
    if wanted is not None:
        for device in devices:
            if device.name == wanted:
                return device
        raise HotspotError("--interface %s: not a Wi-Fi device; there are: %s" % (wanted, names))
    if len(devices) == 1:
        return devices[0]
    if not ask:
        raise HotspotError("several Wi-Fi devices: say which with --interface: %s" % names)
    for number, device in enumerate(devices, 1):
        print("%d  %s  %s  %s" % (number, device.name, device.state, device.connection))
    answer = input("which one becomes the hotspot (1..%d)? " % len(devices)).strip()
    if not answer.isdigit() or not 1 <= int(answer) <= len(devices):
        raise HotspotError("%s is none of 1..%d" % (ascii(answer), len(devices)))
    return devices[int(answer) - 1]


def check_device(device: WifiDevice) -> None:
    """Raise HotspotError if the device cannot be an access point at 2.4 GHz."""
    if device.state == "unavailable":
        raise HotspotError("%s is switched off: nmcli radio wifi on; or rfkill unblock wifi" % device.name)
    if device.state == "unmanaged":
        raise HotspotError(
            "%s is not managed by NetworkManager: sudo nmcli device set %s managed yes"
            % (device.name, device.name)
        )
    can = nmcli.read_properties(device.name)
    if can.get("AP") == "no":
        raise HotspotError(
            "%s cannot be an access point: use another Wi-Fi device, or a router" % device.name
        )
    if can.get("2GHZ") == "no":
        raise HotspotError(
            "%s does not do 2.4 GHz, and robots hear nothing else: use another Wi-Fi device" % device.name
        )


def format_call(call: NmcliCall) -> str:
    """Return a call as a line for a shell."""
    line = " ".join(shlex.quote(word) for word in ["nmcli", *call.arguments])
    if not call.lines:
        return line
    typed = " ".join('"%s"' % text.replace(nmcli.PASSWORD_PLACE, "$PASSWORD") for text in call.lines)
    # read and printf are parts of the shell: neither ps nor the history shows what they get.
    return "read -rs PASSWORD; printf '%%s\\n' %s | HOME=%s %s" % (typed, call.home, line)


def say_what_robots_need(ssid: str, address: str, factory: bool) -> List[str]:
    """Return what a person has to do so that robots come."""
    lines = ["robots must join '%s' and dial %s, port %d" % (ssid, address, DRIVER_PORT)]
    if factory:
        lines += ["robots that were never configured do so by themselves"]
        lines += [
            "everybody knows this password, and who is in the network can drive the robots: for a try only"
        ]
    else:
        lines += [
            "on each robot: cover all sensors while switching it on (purple light); join its network HERO_ROBOT_...;",
            "  open http://192.168.4.1; enter this network, its password, %s and %d; save; switch it off and on"
            % (address, DRIVER_PORT),
        ]
    return [*lines, "then: roslaunch hero_bringup hero_bringup.launch, and rosrun hero_tools check"]


def create(options: argparse.Namespace) -> None:
    """Make the hotspot, or print how."""
    if options.factory and options.ssid not in (None, FACTORY_SSID):
        raise HotspotError("--factory means the network %s: leave --ssid out" % FACTORY_SSID)
    ssid = check_ssid(options.ssid or FACTORY_SSID)
    if options.dry_run and options.interface:
        interface = options.interface  # nothing of NetworkManager is needed to print commands
    else:
        device = choose_device(nmcli.list_wifi_devices(), options.interface, ask=sys.stdin.isatty())
        interface = device.name
    calls = nmcli.make_create_calls(interface, ssid)
    if options.dry_run:
        print("\n".join(map(format_call, calls)))
        return
    check_device(device)
    if not nmcli.may_share():
        raise HotspotError("this user may not share a hotspot" + nmcli.RIGHTS_REMEDY)
    if device.connection not in ("", nmcli.CONNECTION) and not options.yes:
        raise HotspotError(
            "%s is connected to '%s', which would end: --yes if it may" % (interface, device.connection)
        )
    password = read_password(options)
    if nmcli.hotspot_exists():
        for call in nmcli.make_stop_calls():
            nmcli.run_nmcli(call)
    try:
        for call in calls:
            nmcli.run_nmcli(call, password)
    except (NetworkManagerError, KeyboardInterrupt):
        if nmcli.hotspot_exists():
            nmcli.run_nmcli(nmcli.make_stop_calls()[0])
        raise
    address = nmcli.read_hotspot().get("IP4.ADDRESS", nmcli.ADDRESS).split("/")[0]
    print("hotspot '%s' is on, on %s, 2.4 GHz, WPA2" % (ssid, interface))
    print("\n".join(say_what_robots_need(ssid, address, options.factory)))


def show() -> int:
    """Say whether the hotspot is on, and who is in it; the exit code is 1 if it is off."""
    if not nmcli.hotspot_exists():
        print("no hotspot: rosrun hero_tools hotspot create")
        return 1
    found = nmcli.read_hotspot()
    ssid, interface = found.get("802-11-wireless.ssid", "?"), found.get("connection.interface-name", "?")
    address = found.get("IP4.ADDRESS") or found.get("ipv4.addresses", "")
    if found.get("GENERAL.STATE") != "activated":
        print("hotspot '%s' is off: nmcli connection up %s, or create it again" % (ssid, nmcli.CONNECTION))
        return 1
    print(
        "hotspot '%s' is on, on %s; robots dial %s, port %d"
        % (ssid, interface, address.split("/")[0], DRIVER_PORT)
    )
    guests = list_neighbours(interface)
    print("%d in it: %s" % (len(guests), ", ".join(guests)) if guests else "nobody is in it")
    return 0


def list_neighbours(interface: str) -> List[str]:
    """Return the IPv4 addresses that were heard on the interface of late."""
    try:
        result = subprocess.run(
            ["ip", "-4", "neighbour", "show", "dev", interface],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            check=False,
        )
    except OSError:  # the command ip is missing
        return []
    rows = [line.split() for line in result.stdout.decode(errors="replace").splitlines()]
    return sorted(row[0] for row in rows if row and row[-1] in ("REACHABLE", "STALE", "DELAY", "PROBE"))


def stop(options: argparse.Namespace) -> None:
    """Switch the hotspot off and forget it."""
    calls = nmcli.make_stop_calls()
    if options.dry_run:
        print("\n".join(map(format_call, calls)))
        return
    if not nmcli.hotspot_exists():
        print("there is no hotspot")
        return
    for call in calls:
        nmcli.run_nmcli(call)
    print(
        "the hotspot is off; a Wi-Fi network that was left for it comes back by itself, or with nmcli device connect"
    )


def parse_options(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        prog="hotspot", description="The access point that robots join, made by NetworkManager."
    )
    commands = parser.add_subparsers(dest="command", metavar="create | show | stop", required=True)
    making = commands.add_parser("create", help="make the hotspot and switch it on")
    making.add_argument("--ssid", metavar="NAME", help="name of the network (%s)" % FACTORY_SSID)
    making.add_argument(
        "--interface", metavar="NAME", help="Wi-Fi device (the only one; asked where there are several)"
    )
    making.add_argument(
        "--factory", action="store_true", help="network and password of robots that were never configured"
    )
    making.add_argument("--password-stdin", action="store_true", help="read the password from standard input")
    making.add_argument(
        "--band", default="bg", metavar="bg", help="only bg, which is 2.4 GHz: robots hear nothing else"
    )
    making.add_argument(
        "--yes", action="store_true", help="also if the device has a connection, which then ends"
    )
    making.add_argument("--dry-run", action="store_true", help="print the commands of nmcli, and do nothing")
    commands.add_parser("show", help="say whether it is on, and who is in it")
    stopping = commands.add_parser("stop", help="switch it off and forget it")
    stopping.add_argument(
        "--dry-run", action="store_true", help="print the commands of nmcli, and do nothing"
    )
    options = parser.parse_args(arguments)
    if options.command == "create" and options.band != "bg":
        parser.error("--band %s: robots hear 2.4 GHz only (band bg), never 5 GHz" % options.band)
    return options


def run(arguments: Sequence[str]) -> int:
    """Do what the command line says; return the exit status. Raises: HotspotError, NetworkManagerError."""
    options = parse_options(arguments)
    try:
        if options.command == "create":
            create(options)
        elif options.command == "show":
            return show()
        else:
            stop(options)
    except (KeyboardInterrupt, EOFError):
        print("\nhotspot: ended; nothing was changed", file=sys.stderr)
        return command_line.INTERRUPTED
    return 0


def main() -> None:
    """Run the program hotspot."""
    command_line.run(lambda: run(sys.argv[1:]), HotspotError, NetworkManagerError)
