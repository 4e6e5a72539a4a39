"""What the check says of a firewall is what happens to connections: a PC, its robots and a LAN in namespaces."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[2] / "src"
NEEDED = ("nft", "iptables", "ip", "unshare", "bash", "timeout")

SET_UP = """
set -e
mount -t tmpfs tmpfs /run && mkdir -p /run/netns
for name in pc robots lan; do ip netns add $name; ip -n $name link set lo up; done
join() {
  ip link add at_pc type veth peer name at_$1
  ip link set dev at_pc netns pc name $2; ip link set dev at_$1 netns $1 name $2
  ip -n pc addr add $3.1/24 dev $2; ip -n $1 addr add $3.2/24 dev $2
  ip -n pc link set $2 up; ip -n $1 link set $2 up
}
join robots wlan0 10.42.0
join lan eth0 192.168.7
ip netns exec pc "$1" "$2"
"""
TRY = """
import shlex, socket, subprocess, sys
from hero_tools.checkup import firewall
from hero_tools.checkup.packet_rules import admits

PORT = 11411
server = socket.socket()
server.bind(("0.0.0.0", PORT))
server.listen(50)

def reaches(namespace, address):
    dial = ["bash", "-c", "exec 3<>/dev/tcp/%s/%d" % (address, PORT)]
    return subprocess.call(["ip", "netns", "exec", namespace, "timeout", "0.5", *dial], stderr=subprocess.DEVNULL) == 0

def compare(what, robots, lan):
    (finding,) = firewall.check_firewall("wlan0", ["eth0"], PORT)
    tool, rules, reason = firewall.read_rules()
    said = admits(rules, "wlan0", PORT), admits(rules, "eth0", PORT)
    seen = reaches("robots", "10.42.0.1"), reaches("lan", "192.168.7.1")
    assert said == seen == (robots, lan), (what, said, seen)
    assert finding.state == ("FAIL" if not robots else "WARN" if lan else "OK"), (what, finding)

def run(*lines):
    for line in lines:
        subprocess.check_call(shlex.split(line.replace("sudo ", "")))

compare("no rules", True, True)
run(*firewall.make_rules("nft", "wlan0", PORT))
compare("the rules that are printed for nft", True, False)
run("nft flush ruleset", "nft add table inet filter",
    "nft add chain inet filter input '{ type filter hook input priority 0; policy drop; }'")
compare("a chain that drops all", False, False)
run("nft insert rule inet filter input iifname wlan0 tcp dport %d accept" % PORT)
compare("the remedy for it", True, False)
run("nft flush ruleset", *firewall.make_rules("iptables", "wlan0", PORT))
compare("the rules that are printed for iptables", True, False)
print("all of it")
"""

pytestmark = pytest.mark.skipif(
    os.geteuid() != 0 or not all(map(shutil.which, NEEDED)), reason="needs root, nft and iptables"
)


def test_what_is_said_of_the_rules_is_what_happens_to_robots_and_to_others(tmp_path):
    (tmp_path / "try.py").write_text(TRY)
    result = subprocess.run(
        [
            "unshare",
            "--net",
            "--mount",
            "bash",
            "-c",
            SET_UP,
            "bash",
            sys.executable,
            str(tmp_path / "try.py"),
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=dict(os.environ, PYTHONPATH=str(SOURCE), PYTHONDONTWRITEBYTECODE="1"),
        timeout=60,
        check=False,
    )
    assert b"all of it" in result.stdout, result.stdout.decode()
