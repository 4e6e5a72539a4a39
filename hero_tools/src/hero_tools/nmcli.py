"""nmcli, NetworkManager's command line -> its devices, permissions and the one connection of ours.

The password of a hotspot never stands on a command line, where every user of the PC could read it (ps), and in no
file of ours. nmcli's editor takes it from standard input, and NetworkManager keeps it in a file that root alone can
read. nmcli 1.42 would also write each line of its editor into ~/.nmcli-history, readable by all; with a HOME that is
no folder it cannot. Source: nmcli(1), nm-settings-nmcli(5).
"""

import os
import re
import subprocess
from typing import Dict, List, NamedTuple, Sequence

CONNECTION = "hero_hotspot"
ADDRESS = "10.42.0.1"
"""What robots dial that nobody configured."""
PASSWORD_PLACE = "PASSWORD"
NO_HOME = "/dev/null"
TIMEOUT_S = 60.0
NMCLI_NOT_RUNNING = 8  # exit codes of nmcli(1)
ACTIVATION_WAIT_S = 30


RIGHTS_REMEDY = (
    ": run it in a session at the screen (not over ssh),"
    " or give what --dry-run prints to a root shell (sudo -i)"
)


class NetworkManagerError(Exception):
    """NetworkManager cannot do what was asked; the text says why and what to do."""


class WifiDevice(NamedTuple):
    """A Wi-Fi device, and the name of the connection that it has now, empty if none."""

    name: str
    state: str
    connection: str


class NmcliCall(NamedTuple):
    """One call of nmcli, and the lines that it gets on standard input."""

    arguments: Sequence[str]
    lines: Sequence[str] = ()
    home: str = ""


def make_create_calls(interface: str, ssid: str) -> List[NmcliCall]:
    """Return the calls that make the hotspot and switch it on; PASSWORD stands for the password."""
    settings = [
        # 2.4 GHz only: the robots' ESP8266 hears nothing else.
        "ssid", ssid, "mode", "ap", "wifi.band", "bg",
        # WPA2 alone: proto rsn is WPA2, ccmp its cipher.
        "wifi-sec.key-mgmt", "wpa-psk", "wifi-sec.proto", "rsn", "wifi-sec.pairwise", "ccmp", "wifi-sec.group", "ccmp",
        "ipv4.method", "shared", "ipv4.addresses", ADDRESS + "/24", "ipv6.method", "disabled",
    ]  # fmt: skip
    add = [
        "connection",
        "add",
        "type",
        "wifi",
        "ifname",
        interface,
        "con-name",
        CONNECTION,
        "autoconnect",
        "no",
    ]
    edit = ["set wifi-sec.psk " + PASSWORD_PLACE, "save", "quit"]
    return [
        NmcliCall([*add, *settings]),
        NmcliCall(["connection", "edit", CONNECTION], edit, NO_HOME),
        NmcliCall(["--wait", str(ACTIVATION_WAIT_S), "connection", "up", CONNECTION]),
    ]


def make_stop_calls() -> List[NmcliCall]:
    """Return the calls that switch the hotspot off and forget it, with its password."""
    return [NmcliCall(["connection", "delete", CONNECTION])]


def run_nmcli(call: NmcliCall, password: str = "") -> str:
    """Run one call and return its output.

    Raises: NetworkManagerError.
    """
    text = "".join(line.replace(PASSWORD_PLACE, password) + "\n" for line in call.lines)
    environment = dict(os.environ, LC_ALL="C")
    if call.home:
        environment["HOME"] = call.home
    try:
        result = subprocess.run(
            ["nmcli", *call.arguments],
            input=text.encode(),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment,
            timeout=TIMEOUT_S,
            check=False,
        )
    except OSError:
        raise NetworkManagerError(
            "nmcli is not installed: sudo apt install network-manager; without it, make an access point by other means"
            " (2.4 GHz, WPA2, address %s), see docs/network.md" % ADDRESS
        ) from None
    except subprocess.TimeoutExpired:
        raise NetworkManagerError(
            "nmcli did not end within %g s: systemctl restart NetworkManager" % TIMEOUT_S
        ) from None
    output = result.stdout.decode(errors="replace")
    if result.returncode == NMCLI_NOT_RUNNING or "Could not create NMClient object" in output:
        raise NetworkManagerError(
            "NetworkManager does not run: sudo systemctl start NetworkManager; where another program manages the"
            " network, make the access point with that (docs/network.md)"
        )
    # The editor ends with 0 also if it could not save.
    if result.returncode != 0 or (call.lines and "successfully updated" not in output):
        raise NetworkManagerError(explain_failure(output, call.arguments))
    return output


def explain_failure(output: str, arguments: Sequence[str]) -> str:
    """Return one line for what nmcli said, without what was typed into its editor."""
    errors = [line for line in output.splitlines() if line.startswith("Error:")] or [
        "nmcli %s failed" % " ".join(arguments[:3])
    ]
    text = " ".join(errors)
    if re.search("privileges|not authorized|permission", text, re.IGNORECASE):
        return text + RIGHTS_REMEDY
    if "No suitable device" in text:
        return (
            text + ": does the device share hotspots (nmcli -f WIFI-PROPERTIES device show),"
            " is its radio on (nmcli radio wifi on)?"
        )
    return text


def split_terse(line: str) -> List[str]:
    """Split a line of nmcli -t, in which a colon within a field is escaped."""
    return [field.replace("\\:", ":").replace("\\\\", "\\") for field in re.split(r"(?<!\\):", line)]


def list_wifi_devices() -> List[WifiDevice]:
    """Return the Wi-Fi devices of this PC."""
    output = run_nmcli(NmcliCall(["-t", "-f", "DEVICE,TYPE,STATE,CONNECTION", "device", "status"]))
    rows = [split_terse(line) for line in output.splitlines()]
    return [WifiDevice(row[0], row[2], row[3]) for row in rows if len(row) == 4 and row[1] == "wifi"]


def read_properties(device: str) -> Dict[str, str]:
    """Return what a Wi-Fi device can do, e.g. {"AP": "yes", "2GHZ": "yes"}."""
    output = run_nmcli(NmcliCall(["-t", "-f", "WIFI-PROPERTIES", "device", "show", device]))
    rows = [split_terse(line) for line in output.splitlines()]
    return {row[0].replace("WIFI-PROPERTIES.", ""): row[1] for row in rows if len(row) == 2}


def may_share() -> bool:
    """Whether this user may share a hotspot, or will be asked for a password."""
    output = run_nmcli(NmcliCall(["-t", "-f", "PERMISSION,VALUE", "general", "permissions"]))
    values = dict(row for row in map(split_terse, output.splitlines()) if len(row) == 2)
    needed = (
        "org.freedesktop.NetworkManager.wifi.share.protected",
        "org.freedesktop.NetworkManager.network-control",
    )
    return all(values.get(name, "yes") in ("yes", "auth") for name in needed)


def hotspot_exists() -> bool:
    """Whether the connection of ours is there, on or off."""
    output = run_nmcli(NmcliCall(["-t", "-f", "NAME", "connection", "show"]))
    return CONNECTION in [split_terse(line)[0] for line in output.splitlines()]


def read_hotspot() -> Dict[str, str]:
    """Return the settings of the hotspot, by nmcli's names, without its password."""
    fields = "802-11-wireless.ssid connection.interface-name ipv4.addresses GENERAL.STATE IP4.ADDRESS"
    output = run_nmcli(NmcliCall(["-t", "-f", fields.replace(" ", ","), "connection", "show", CONNECTION]))
    rows = [split_terse(line) for line in output.splitlines()]
    return {row[0].split("[")[0]: row[1] for row in rows if len(row) == 2}
