"""Firewall rules, as nft or iptables print them -> whether they let a robot's first packet in.

Only what decides about "a new TCP connection to this port on this interface" is read. A rule with a condition that is
not understood (an address, a mark) is one that does not hold for everybody, and is passed over.
Formats: libnftables-json(5), iptables-save.
"""

import json
import shlex
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

ANY_OTHER_INTERFACE = "*"
"""Stands for an interface that no rule names."""


class PacketRule(NamedTuple):
    """One rule; None in a condition means that it holds for all."""

    interfaces: Optional[Tuple[str, ...]]
    interfaces_negated: bool
    ports: Optional[Tuple[Tuple[int, int], ...]]
    others_only: bool  # has conditions that are not understood, or that a new TCP connection does not meet
    verdict: str  # accept, drop, return, go:CHAIN, or empty for one that only counts


class RuleSet(NamedTuple):
    """Chains by name, and those that packets to this PC enter, with what becomes of a packet at their end."""

    chains: Dict[str, List[PacketRule]]
    entries: Dict[str, str]


def admits(rules: RuleSet, interface: str, port: int) -> bool:
    """Whether a new TCP connection to port that comes in on interface passes every chain."""
    return all(
        (_walk(rules, chain, interface, port, 0) or policy) != "drop"
        for chain, policy in rules.entries.items()
    )


def _walk(rules: RuleSet, chain: str, interface: str, port: int, depth: int) -> str:
    for rule in rules.chains.get(chain, []):
        if rule.others_only or not _matches(rule, interface, port):
            continue
        if rule.verdict == "return":
            return ""
        if rule.verdict in ("accept", "drop"):
            return rule.verdict
        if rule.verdict.startswith("go:") and depth < 20:
            verdict = _walk(rules, rule.verdict[3:], interface, port, depth + 1)
            if verdict:
                return verdict
    return ""


def _matches(rule: PacketRule, interface: str, port: int) -> bool:
    if rule.interfaces is not None:
        named = any(_name_fits(pattern, interface) for pattern in rule.interfaces)
        if named == rule.interfaces_negated:
            return False
    return rule.ports is None or any(low <= port <= high for low, high in rule.ports)


def _name_fits(pattern: str, interface: str) -> bool:
    if pattern[-1:] in ("*", "+"):
        return interface.startswith(pattern[:-1])
    return pattern == interface


def read_nft(text: str) -> RuleSet:
    """Read what `nft -j list ruleset` prints.

    Raises: ValueError for anything else.
    """
    chains: Dict[str, List[PacketRule]] = {}
    entries: Dict[str, str] = {}
    for item in json.loads(text)["nftables"]:
        if "chain" in item:
            chain = item["chain"]
            if chain["family"] in ("ip", "inet") and chain.get("hook") == "input":
                entries[_nft_name(chain, chain["name"])] = chain.get("policy", "accept")
        elif "rule" in item:
            rule = item["rule"]
            chains.setdefault(_nft_name(rule, rule["chain"]), []).append(_read_nft_rule(rule))
    return RuleSet(chains, entries)


def _nft_name(owner: Dict[str, Any], chain: str) -> str:
    return "%s %s %s" % (owner["family"], owner["table"], chain)


def _read_nft_rule(rule: Dict[str, Any]) -> PacketRule:
    interfaces: Optional[Tuple[str, ...]] = None
    negated = False
    ports: Optional[Tuple[Tuple[int, int], ...]] = None
    others_only = False
    verdict = ""
    for part in rule["expr"]:
        if "match" in part:
            left, right, operator = part["match"]["left"], part["match"]["right"], part["match"]["op"]
            values = right["set"] if isinstance(right, dict) and "set" in right else right
            values = values if isinstance(values, list) else [values]
            if left.get("meta", {}).get("key") in ("iifname", "iif"):
                interfaces = tuple(str(value) for value in values)
                negated = operator == "!="
            elif left.get("payload", {}) == {"protocol": "tcp", "field": "dport"} and operator != "!=":
                ports = tuple(_read_nft_port(value) for value in values)
            elif left.get("ct", {}).get("key") == "state":
                others_only = others_only or ("new" in values) == (operator == "!=")
            elif left.get("meta", {}).get("key") == "l4proto":
                others_only = others_only or "tcp" not in values
            else:
                others_only = True
        elif "accept" in part:
            verdict = "accept"
        elif "drop" in part or "reject" in part:
            verdict = "drop"
        elif "return" in part:
            verdict = "return"
        elif "jump" in part or "goto" in part:
            verdict = "go:" + _nft_name(rule, (part.get("jump") or part.get("goto"))["target"])
        elif "xt" in part:
            # A part of iptables that nft cannot express.
            if (part["xt"] or {}).get("name") == "REJECT":
                verdict = "drop"
            else:
                others_only = True
    return PacketRule(interfaces, negated, ports, others_only, verdict)


def _read_nft_port(value: Any) -> Tuple[int, int]:
    low, high = value["range"] if isinstance(value, dict) and "range" in value else (value, value)
    # A named set, or anything else that is no number, fits no port.
    return (low, high) if isinstance(low, int) and isinstance(high, int) else (1, 0)


def read_iptables(text: str) -> RuleSet:
    """Read what `iptables -S` prints."""
    chains: Dict[str, List[PacketRule]] = {}
    policy = "accept"
    for line in text.splitlines():
        words = shlex.split(line)
        if words[:2] == ["-P", "INPUT"]:
            policy = "accept" if words[2] == "ACCEPT" else "drop"
        elif words[:1] == ["-A"]:
            chains.setdefault(words[1], []).append(_read_iptables_rule(words[2:]))
    return RuleSet(chains, {"INPUT": policy})


def _read_iptables_rule(words: List[str]) -> PacketRule:
    interfaces: Optional[Tuple[str, ...]] = None
    ports: Optional[Tuple[Tuple[int, int], ...]] = None
    others_only = negated = not_next = False
    verdict = ""
    while words:
        option, value, words = words[0], (words[1:] or [""])[0], words[2:]
        if option == "!":
            not_next, words = True, [value, *words]
            continue
        if option == "-i":
            interfaces, negated = (value,), not_next
        elif option == "-p":
            others_only = others_only or (value in ("tcp", "all")) == not_next
        elif option in ("--dport", "--dports") and not not_next:
            ports = tuple(_read_iptables_port(part) for part in value.split(","))
        elif option in ("--state", "--ctstate"):
            others_only = others_only or ("NEW" in value.split(",")) == not_next
        elif option in ("-j", "-g"):
            verdict = {"ACCEPT": "accept", "DROP": "drop", "REJECT": "drop", "RETURN": "return"}.get(
                value, "go:" + value
            )
        elif option not in ("-m", "--comment", "--reject-with"):
            others_only = True
        not_next = False
    return PacketRule(interfaces, negated, ports, others_only, verdict)


def _read_iptables_port(text: str) -> Tuple[int, int]:
    low, _, high = text.partition(":")
    return (int(low), int(high or low)) if low.isdigit() and (high or low).isdigit() else (1, 0)
