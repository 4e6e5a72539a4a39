"""The hotspot against a real NetworkManager, in a namespace of its own: everything but the radio."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[2] / "src"
NEEDED = ("NetworkManager", "nmcli", "dbus-daemon", "unshare")
PASSWORD = "pass word#with'quotes\"\\ and $`!~"

START = """
set -e
mount -t tmpfs tmpfs /run && mkdir -p /run/dbus
mkdir -p /etc/NetworkManager/system-connections /var/lib/NetworkManager
mount -t tmpfs tmpfs /etc/NetworkManager/system-connections
mount -t tmpfs tmpfs /var/lib/NetworkManager
dbus-daemon --system --fork --nopidfile
NetworkManager --no-daemon --log-level=ERR &
manager=$!
trap "kill $manager" EXIT  # the namespace ends the rest
for _ in $(seq 200); do nmcli general >/dev/null 2>&1 && break; sleep 0.05; done
"$@"
"""
TRY = """
import argparse, io, os, subprocess, sys
from pathlib import Path
from hero_tools import hotspot

hotspot.choose_device = lambda wanted: ("wlan0", "")  # the namespace has no radio
kept = Path("/etc/NetworkManager/system-connections/hero_hotspot.nmconnection")


def look(*arguments, **options):
    if "up" in arguments:
        text = kept.read_text()
        assert "psk=" in text and "band=bg" in text and "proto=rsn" in text and "method=shared" in text, text
        assert oct(kept.stat().st_mode & 0o777) == "0o600"
        told = ["nmcli", "-s", "-e", "no", "-g", "802-11-wireless-security.psk", "connection", "show", "hero_hotspot"]
        assert subprocess.check_output(told).decode() == sys.argv[1] + "\\n"
        hotspot.show_status()
    return run_nmcli(*arguments, **options)

run_nmcli, hotspot.run_nmcli = hotspot.run_nmcli, look
sys.stdin = io.StringIO(sys.argv[1] + "\\n")
try:
    hotspot.main(["create", "--ssid", "my net's", "--password-stdin"])
except hotspot.HotspotError as error:
    print(error)
assert os.listdir(os.environ["HOME"]) == [], "nmcli left something: " + str(os.listdir(os.environ["HOME"]))
assert not hotspot.exists() and not kept.exists()
print("all of it")
"""

pytestmark = pytest.mark.skipif(
    os.geteuid() != 0 or not all(map(shutil.which, NEEDED)),
    reason="needs root and NetworkManager, which no script installs: it would take over this machine's network",
)


def test_nmcli_takes_every_command_and_keeps_the_password_secret(tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    (tmp_path / "try.py").write_text(TRY)
    environment = dict(os.environ, HOME=str(home), PYTHONPATH=str(SOURCE), PYTHONDONTWRITEBYTECODE="1")
    namespaces = ["unshare", "--net", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc"]
    result = subprocess.run(
        [*namespaces, "bash", "-c", START, "bash", sys.executable, str(tmp_path / "try.py"), PASSWORD],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=environment,
        timeout=60,
        check=False,
    )
    output = result.stdout.decode()
    assert "all of it" in output, output
    assert "hotspot 'my net's' is off" in output
    assert "No suitable device" in output  # what is left to the radio
