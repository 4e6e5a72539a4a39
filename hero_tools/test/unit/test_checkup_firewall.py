"""Firewall rules as nft 1.0.6 and iptables 1.8.9 print them, and what they mean for robots and for others."""

import json

import pytest

from hero_tools.checkup.finding import FAIL, OK, WARN
from hero_tools.checkup.firewall import judge, make_rules
from hero_tools.checkup.packet_rules import admits, read_iptables, read_nft

PORT = 11411
LOOPBACK = {"match": {"op": "==", "left": {"meta": {"key": "iifname"}}, "right": "lo"}}
ESTABLISHED = {"match": {"op": "in", "left": {"ct": {"key": "state"}}, "right": ["established", "related"]}}
NOT_WLAN0 = {"match": {"op": "!=", "left": {"meta": {"key": "iifname"}}, "right": {"set": ["lo", "wlan0"]}}}
FROM_ONE_HOST = {
    "match": {"op": "==", "left": {"payload": {"protocol": "ip", "field": "saddr"}}, "right": "10.0.0.9"}
}
ACCEPT, DROP = {"accept": None}, {"drop": None}
REJECT_OF_IPTABLES = {"xt": {"type": "target", "name": "REJECT"}}


def to_port(*ports):
    left = {"payload": {"protocol": "tcp", "field": "dport"}}
    return {
        "match": {"op": "==", "left": left, "right": {"set": list(ports)} if len(ports) > 1 else ports[0]}
    }


def make_nft(policy, *rules, family="inet", jumps=()):
    """Return the JSON of a table with one input chain, and one chain `robots` to jump to."""
    chain = {"family": family, "table": "filter", "name": "input", "hook": "input", "policy": policy}
    items = [{"metainfo": {}}, {"table": {"family": family, "name": "filter"}}, {"chain": chain}]
    items += [
        {"rule": {"family": family, "table": "filter", "chain": name, "expr": list(rule)}}
        for name, chain_rules in (("input", rules), ("robots", jumps))
        for rule in chain_rules
    ]
    return read_nft(json.dumps({"nftables": items}))


@pytest.mark.parametrize(
    ("rules", "on_wlan0", "on_eth0"),
    [
        (make_nft("accept"), True, True),
        (make_nft("drop"), False, False),
        (make_nft("drop", [LOOPBACK, ACCEPT], [ESTABLISHED, ACCEPT]), False, False),
        (make_nft("drop", [to_port(22, PORT), ACCEPT]), True, True),
        (make_nft("drop", [to_port({"range": [11000, 12000]}, 22), ACCEPT]), True, True),
        (make_nft("drop", [to_port({"range": [12000, 13000]}, 22), ACCEPT]), False, False),
        (make_nft("drop", [FROM_ONE_HOST, ACCEPT]), False, False),
        (make_nft("accept", [NOT_WLAN0, to_port(PORT), DROP]), True, False),
        (make_nft("accept", [to_port(PORT), {"counter": {}}, REJECT_OF_IPTABLES], family="ip"), False, False),
        (make_nft("accept", [to_port(PORT), DROP], family="ip6"), True, True),
        (make_nft("drop", [{"jump": {"target": "robots"}}], jumps=[[to_port(PORT), ACCEPT]]), True, True),
        (make_nft("drop", [{"jump": {"target": "robots"}}], jumps=[[{"return": None}]]), False, False),
        (make_nft("accept", [{"goto": {"target": "input"}}]), True, True),
    ],
)
def test_rules_of_nft_mean_what_the_kernel_does_with_them(rules, on_wlan0, on_eth0):
    assert (admits(rules, "wlan0", PORT), admits(rules, "eth0", PORT)) == (on_wlan0, on_eth0)


@pytest.mark.parametrize(
    ("text", "on_wlan0", "on_eth0"),
    [
        ("-P INPUT ACCEPT", True, True),
        ("-P INPUT DROP\n-A INPUT -i lo -j ACCEPT", False, False),
        ("-P INPUT DROP\n-A INPUT -i wlan0 -p tcp -m tcp --dport 11411 -j ACCEPT", True, False),
        (
            "-P INPUT DROP\n-A INPUT ! -i eth0 -p tcp -m multiport --dports 22,11000:12000 -j ACCEPT",
            True,
            False,
        ),
        ("-P INPUT DROP\n-A INPUT -m conntrack --ctstate RELATED,ESTABLISHED -j ACCEPT", False, False),
        ("-P INPUT ACCEPT\n-A INPUT -p udp -j DROP", True, True),
        ("-P INPUT ACCEPT\n-A INPUT -s 10.0.0.0/8 -j DROP", True, True),
        (
            "-P INPUT ACCEPT\n-A INPUT -p tcp -m tcp --dport 11411 -j REJECT --reject-with tcp-reset",
            False,
            False,
        ),
        (
            "-P INPUT DROP\n-N robots\n-A INPUT -i wl+ -j robots\n-A robots -p tcp --dport 11411 -j ACCEPT",
            True,
            False,
        ),
        (
            '-P INPUT DROP\n-A INPUT -p tcp --dport 11411 -m comment --comment "for robots" -j ACCEPT',
            True,
            True,
        ),
    ],
)
def test_rules_of_iptables_mean_what_the_kernel_does_with_them(text, on_wlan0, on_eth0):
    rules = read_iptables(text)
    assert (admits(rules, "wlan0", PORT), admits(rules, "eth0", PORT)) == (on_wlan0, on_eth0)


@pytest.mark.parametrize(
    ("rules", "state", "says"),
    [
        (make_nft("accept"), WARN, "open to the network on eth0 too"),
        (make_nft("drop"), FAIL, "closes port 11411 to robots on wlan0"),
        (make_nft("accept", [NOT_WLAN0, to_port(PORT), DROP]), OK, "and no other network"),
    ],
)
def test_open_to_others_is_a_warning_and_closed_to_robots_a_failure(rules, state, says):
    finding = judge(rules, "nft", "wlan0", ["eth0"], PORT, make_rules("nft", "wlan0", PORT))
    assert finding.state == state
    assert says in finding.says
    assert bool(finding.remedy) == (state != OK)


@pytest.mark.parametrize("tool", ["nft", "iptables", "ufw", "firewalld"])
def test_the_rules_that_are_printed_name_port_and_interface(tool):
    text = "\n".join(make_rules(tool, "wlan0", PORT))
    assert "wlan0" in text
    assert str(PORT) in text


def test_the_rules_printed_for_iptables_let_robots_in_and_others_not():
    printed = [line.replace("sudo iptables -I", "-A") for line in make_rules("iptables", "wlan0", PORT)]
    rules = read_iptables("\n".join(["-P INPUT ACCEPT", *reversed(printed)]))  # -I puts each before the last
    assert admits(rules, "wlan0", PORT)
    assert admits(rules, "lo", PORT)
    assert not admits(rules, "eth0", PORT)
