"""The access point that robots join: a NetworkManager connection called hero_hotspot.

    rosrun hero_tools hotspot create
    rosrun hero_tools hotspot status
    rosrun hero_tools hotspot remove

Needs no ROS. The password is never on a command line, where every user of the PC could read it (ps), nor in a file of
ours: nmcli's editor reads it from standard input, and NetworkManager stores it readable by root only. nmcli 1.42 also
appends each line of its editor to ~/.nmcli-history, readable by all; a HOME that is no directory prevents that.
Source: nmcli(1), nm-settings-nmcli(5).
"""

import argparse
import getpass
import os
import re
import subprocess
import sys
from typing import List, Optional, Sequence, Tuple

from hero_node import HeroError

CONNECTION = "hero_hotspot"
ADDRESS = "10.42.0.1"  # robots connect to it by default
DRIVER_PORT = 11411
FACTORY_SSID = "hero_network"
FACTORY_PASSWORD = "s3cr3tp4ss"  # printed in the robots' documentation: no secret
SSID_BYTES_MAX = 32  # IEEE 802.11
PASSWORD_LENGTHS = (8, 63)  # a WPA2 passphrase
TIMEOUT_S = 60.0
NMCLI_NOT_RUNNING = 8  # exit status of nmcli(1)

SETTINGS = (
    # 2.4 GHz only: the robots' ESP8266 has no 5 GHz radio.
    "mode", "ap", "wifi.band", "bg",
    # WPA2 only: proto rsn is WPA2, ccmp its cipher.
    "wifi-sec.key-mgmt", "wpa-psk", "wifi-sec.proto", "rsn", "wifi-sec.pairwise", "ccmp", "wifi-sec.group", "ccmp",
    "ipv4.method", "shared", "ipv4.addresses", ADDRESS + "/24", "ipv6.method", "disabled",
)  # fmt: skip


class HotspotError(HeroError):
    """The hotspot cannot be created or removed; the text is one line with the remedy."""


def run_nmcli(*arguments: str, typed: str = "") -> str:
    """Run nmcli and return its output; typed: lines for its editor. Raises: HotspotError."""
    environment = dict(os.environ, LC_ALL="C", **({"HOME": "/dev/null"} if typed else {}))
    try:
        result = subprocess.run(
            ["nmcli", *arguments], input=typed.encode(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            env=environment, timeout=TIMEOUT_S, check=False,
        )  # fmt: skip
    except OSError:
        raise HotspotError("nmcli is not installed: sudo apt install network-manager; or see docs/network.md") from None
    except subprocess.TimeoutExpired:
        raise HotspotError(f"nmcli did not end within {TIMEOUT_S:g} s: systemctl restart NetworkManager") from None
    output = result.stdout.decode(errors="replace")
    if result.returncode == NMCLI_NOT_RUNNING or "Could not create NMClient object" in output:
        raise HotspotError("NetworkManager is not running: sudo systemctl start NetworkManager")
    # The editor exits with 0 even if it could not save, and repeats what was typed: no line of it but errors is shown.
    if result.returncode != 0 or (typed and "successfully updated" not in output):
        errors = [line for line in output.splitlines() if line.startswith("Error:")]
        text = " ".join(errors) or f"nmcli {' '.join(arguments[:2])} failed"
        if re.search("privileges|not authorized|permission", text, re.IGNORECASE):
            text += ": run this in a desktop session (not over ssh), or as root"
        raise HotspotError(text)
    return output


def read_fields(*arguments: str) -> List[List[str]]:
    """Run nmcli -t and return its lines split into fields. Raises: HotspotError."""
    rows = [re.split(r"(?<!\\):", line) for line in run_nmcli("-t", "-f", *arguments).splitlines()]
    return [[field.replace("\\:", ":").replace("\\\\", "\\") for field in row] for row in rows]


def exists() -> bool:
    """Return whether the connection exists, up or down."""
    return [CONNECTION] in read_fields("NAME", "connection", "show")


def choose_device(wanted: Optional[str]) -> Tuple[str, str]:
    """Return name and current connection of a Wi-Fi device that can be an access point. Raises: HotspotError."""
    rows = read_fields("DEVICE,TYPE,STATE,CONNECTION", "device", "status")
    devices = {row[0]: (row[2], row[3]) for row in rows if len(row) == 4 and row[1] == "wifi"}
    if not devices:
        raise HotspotError("no Wi-Fi device: is one plugged in (nmcli device), is its radio on (rfkill list)?")
    name = wanted or ", ".join(devices)
    if name not in devices:
        raise HotspotError(f"choose one of the Wi-Fi devices with --interface: {', '.join(devices)}")
    state, connection = devices[name]
    if state == "unavailable":
        raise HotspotError(f"{name} is switched off: nmcli radio wifi on; or rfkill unblock wifi")
    if state == "unmanaged":
        raise HotspotError(f"{name} is unmanaged: sudo nmcli device set {name} managed yes")
    can = dict(row for row in read_fields("WIFI-PROPERTIES", "device", "show", name) if len(row) == 2)
    for capability, text in (("AP", "cannot be an access point"), ("2GHZ", "has no 2.4 GHz, which robots need")):
        if can.get("WIFI-PROPERTIES." + capability) == "no":
            raise HotspotError(f"{name} {text}: use another Wi-Fi device, or a router")
    return name, connection


def read_password(from_stdin: bool) -> str:
    """Return the password from standard input or the person at the terminal. Raises: HotspotError."""
    if not from_stdin and not sys.stdin.isatty():
        raise HotspotError("no terminal to ask for the password: --password-stdin reads it from standard input")
    try:
        if from_stdin:
            password = sys.stdin.readline().rstrip("\n")
        else:
            password = getpass.getpass("password of the new network (8 to 63 characters): ")
            if getpass.getpass("repeat it: ") != password:
                raise HotspotError("the two passwords differ: start again")
    except (UnicodeDecodeError, EOFError):
        raise HotspotError("the password is not text: use ASCII letters, digits and punctuation") from None
    low, high = PASSWORD_LENGTHS
    if not low <= len(password) <= high:
        raise HotspotError("the password has %d characters; WPA2 needs %d to %d" % (len(password), low, high))
    if not all(" " <= letter <= "~" for letter in password) or password != password.strip():
        raise HotspotError("the password has a non-ASCII character, or a space at an end: choose another")
    return password


def create(options: argparse.Namespace) -> int:
    """Create the hotspot and switch it on. Raises: HotspotError."""
    ssid = options.ssid or FACTORY_SSID
    if options.factory and ssid != FACTORY_SSID:
        raise HotspotError(f"--factory means the network {FACTORY_SSID}: omit --ssid")
    if not ssid.isprintable() or not 1 <= len(ssid.encode()) <= SSID_BYTES_MAX:
        raise HotspotError("--ssid %s: must be 1 to %d bytes of printable text" % (ascii(ssid), SSID_BYTES_MAX))
    device, connection = choose_device(options.interface)
    if connection not in ("", CONNECTION) and not options.yes:
        raise HotspotError(f"{device} is connected to '{connection}': --yes disconnects it")
    password = FACTORY_PASSWORD if options.factory else read_password(options.password_stdin)
    if exists():
        run_nmcli("connection", "delete", CONNECTION)
    try:
        wifi = ["type", "wifi", "ifname", device, "con-name", CONNECTION, "autoconnect", "no", "ssid", ssid]
        run_nmcli("connection", "add", *wifi, *SETTINGS)
        run_nmcli("connection", "edit", CONNECTION, typed=f"set wifi-sec.psk {password}\nsave\nquit\n")
        run_nmcli("--wait", "30", "connection", "up", CONNECTION)
    except (HotspotError, KeyboardInterrupt):
        if exists():
            run_nmcli("connection", "delete", CONNECTION)
        raise
    print(f"hotspot '{ssid}' is on ({device}, 2.4 GHz, WPA2)")
    if options.factory:
        print("robots with factory settings join it; its password is public: for first tries only")
    else:
        print("on each robot: cover all sensors while switching it on (purple light); join its network HERO_ROBOT_...;")
        print("  open http://192.168.4.1; enter this network, its password, %s and %d" % (ADDRESS, DRIVER_PORT))
    print("then: roslaunch hero_bringup hero_bringup.launch, and rosrun hero_tools check")
    return 0


def show_status() -> int:
    """Print whether the hotspot is on; the exit status is 1 if it is not."""
    if not exists():
        print("no hotspot: rosrun hero_tools hotspot create")
        return 1
    names = "802-11-wireless.ssid,connection.interface-name,GENERAL.STATE"
    found = dict(row for row in read_fields(names, "connection", "show", CONNECTION) if len(row) == 2)
    ssid, device = found.get("802-11-wireless.ssid"), found.get("connection.interface-name")
    if found.get("GENERAL.STATE") != "activated":
        print(f"hotspot '{ssid}' is off: nmcli connection up {CONNECTION}")
        return 1
    print("hotspot '%s' is on (%s); robots connect to %s, port %d" % (ssid, device, ADDRESS, DRIVER_PORT))
    return 0


def remove() -> int:
    """Switch the hotspot off and delete it, with its password."""
    if exists():
        run_nmcli("connection", "delete", CONNECTION)
    print("the hotspot is removed; nmcli device connect brings an earlier Wi-Fi connection back")
    return 0


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Do what the command line says; return the exit status. Raises: HotspotError."""
    parser = argparse.ArgumentParser(prog="hotspot", description="The access point that robots join.")
    commands = parser.add_subparsers(dest="command", metavar="create | status | remove", required=True)
    making = commands.add_parser("create", help="create the hotspot and switch it on")
    making.add_argument("--ssid", metavar="NAME", help=f"name of the network ({FACTORY_SSID})")
    making.add_argument("--interface", metavar="NAME", help="Wi-Fi device (default: the only one)")
    making.add_argument("--factory", action="store_true", help="network and password of unconfigured robots")
    making.add_argument("--password-stdin", action="store_true", help="read the password from standard input")
    making.add_argument("--yes", action="store_true", help="disconnect the device's current connection")
    commands.add_parser("status", help="print whether the hotspot is on")
    commands.add_parser("remove", help="switch the hotspot off and delete it")
    options = parser.parse_args(arguments)
    if options.command == "create":
        return create(options)
    return show_status() if options.command == "status" else remove()
