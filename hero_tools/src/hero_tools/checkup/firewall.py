"""The firewall of this PC -> who reaches the driver's port, and the rules that let robots in and others not.

Reads only; rules are printed, never set. rosserial and ROS have no passwords, so a closed port is all there is.
"""

import os
from pathlib import Path
from typing import List, Optional, Sequence, Tuple

from .finding import FAIL, OK, WARN, Finding
from .packet_rules import ANY_OTHER_INTERFACE, RuleSet, admits, read_iptables, read_nft
from .system_command import NOT_THERE, ask_system

UFW_SETTINGS = Path("/etc/ufw/ufw.conf")
POINT = "firewall"


def make_rules(tool: str, interface: str, port: int) -> List[str]:
    """Return the commands that open port to the network on interface, and close it to all others but this PC."""
    if tool == "ufw":
        return [
            "sudo ufw allow in on %s to any port %d proto tcp" % (interface, port),
            "sudo ufw deny %d/tcp" % port,
        ]
    if tool == "firewalld":
        return [
            "sudo firewall-cmd --permanent --new-zone=robots",
            "sudo firewall-cmd --permanent --zone=robots --add-interface=%s --add-port=%d/tcp"
            % (interface, port),
            "sudo firewall-cmd --permanent --zone=robots --add-service=dhcp --add-service=dns",
            "sudo firewall-cmd --reload",
        ]
    if tool == "iptables":
        return [
            "sudo iptables -I INPUT -p tcp --dport %d -j DROP" % port,
            "sudo iptables -I INPUT -i lo -p tcp --dport %d -j ACCEPT" % port,
            "sudo iptables -I INPUT -i %s -p tcp --dport %d -j ACCEPT" % (interface, port),
        ]
    return [
        "sudo nft add table inet hero_robots",
        "sudo nft add chain inet hero_robots input '{ type filter hook input priority -5; }'",
        'sudo nft add rule inet hero_robots input iifname != \'{ "lo", "%s" }\' tcp dport %d drop'
        % (interface, port),
    ]


def read_rules() -> Tuple[str, Optional[RuleSet], str]:
    """Return the tool that sets the rules here, the rules, and why they could not be read if they are None."""
    tool = "nft"
    if "ENABLED=yes" in (UFW_SETTINGS.read_text() if UFW_SETTINGS.is_file() else ""):
        tool = "ufw"
    elif ask_system(["firewall-cmd", "--state"]).output.strip() == "running":
        tool = "firewalld"
    answer = ask_system(["nft", "-j", "list", "ruleset"])
    if answer.code == 0:
        return tool, read_nft(answer.output), ""
    without_nft = answer.code == NOT_THERE
    if without_nft:
        answer = ask_system(["iptables", "-S"])
        tool = "iptables" if tool == "nft" else tool
        if answer.code == 0:
            return tool, read_iptables(answer.output), ""
        if answer.code == NOT_THERE:
            return tool, None, "neither nft nor iptables is installed"
    if os.geteuid() != 0:
        return tool, None, "its rules can only be read as root"
    return tool, None, " ".join((answer.errors or answer.output).split())[:200]


def check_firewall(interface: Optional[str], others: Sequence[str], port: int) -> List[Finding]:
    """Judge who reaches port.

    interface: of the robots' network, None if it is not known; others: this PC's interfaces to other networks.
    """
    tool, rules, reason = read_rules()
    remedy = make_rules(tool, interface or "INTERFACE", port)
    if interface is None:
        remedy.append(
            "INTERFACE is the one to the robots' network: check --interface NAME prints it filled in"
        )
    if rules is None:
        if "installed" in reason and tool == "iptables":
            state, says = (WARN, "%s: every network of this PC reaches port %d" % (reason, port))
            remedy = ["sudo apt install nftables", *make_rules("nft", interface or "INTERFACE", port)]
            return [Finding(POINT, state if others else OK, says, remedy if others else ())]
        look = (
            "sudo nft list ruleset"
            if tool in ("nft", "firewalld")
            else "sudo %s" % {"ufw": "ufw status"}.get(tool, "iptables -S")
        )
        return [
            Finding(
                POINT,
                WARN,
                "%s: whether port %d is open to robots is not known" % (reason, port),
                ["look: " + look, "to open it to robots, and to nobody else:", *remedy],
            )
        ]
    return [judge(rules, tool, interface, others, port, remedy)]


def judge(
    rules: RuleSet,
    tool: str,
    interface: Optional[str],
    others: Sequence[str],
    port: int,
    remedy: Sequence[str],
) -> Finding:
    """Return what the rules mean for robots on interface and for the networks on others."""
    open_to = [name for name in others if admits(rules, name, port)]
    robots_in = admits(rules, interface or ANY_OTHER_INTERFACE, port)
    if interface is not None and not robots_in:
        opening = remedy
        if tool == "nft":
            # What one table drops, no other table can let in.
            opening = [
                "in the chain that drops it (sudo nft list ruleset shows which), before the drop:",
                'iifname "%s" tcp dport %d accept' % (interface, port),
            ]
        return Finding(POINT, FAIL, "closes port %d to robots on %s" % (port, interface), opening)
    if open_to:
        says = "port %d is open to the network on %s too: who reaches it can claim to be a robot" % (
            port,
            ", ".join(open_to),
        )
        return Finding(POINT, WARN, says, ["to keep it to the robots' network:", *remedy])
    if interface is None:
        return Finding(POINT, OK, "port %d is not open to other networks" % port)
    return Finding(POINT, OK, "lets robots on %s in to port %d, and no other network" % (interface, port))
