"""Points on ROS's network, and the check as a whole: names that lead elsewhere, silent drivers, and what is skipped."""

import json
import sys
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest

from hero_msgs.msg import Robot, RobotArray
from hero_node import NodeError
from hero_tools import check, hotspot
from hero_tools.checkup import computer, graph, network, points
from hero_tools.checkup.graph import CONNECT_TIMEOUT_S, LINES_MAX, REPORT_TIMEOUT_S, OwnNode, describe_report
from hero_tools.checkup.network import Address
from hero_tools.checkup.points import FAIL, OK, WARN, Finding

OWN = [Address("wlan0", "10.42.0.1")]


@pytest.fixture(name="names")
def make_names(monkeypatch):
    """The addresses of names; this PC registers as `pc`, and the master is at `master`."""
    addresses = {"pc": {"10.42.0.1"}, "master": {"10.42.0.1"}}
    monkeypatch.setenv("ROS_MASTER_URI", "http://master:11311")
    for name in ("ROS_IP", "ROS_HOSTNAME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(graph, "resolve", lambda name: addresses.get(name, set()))
    monkeypatch.setattr(graph.rosgraph.network, "get_host_name", lambda: "pc")
    monkeypatch.setattr(graph, "find_source_address", lambda target: "10.42.0.1")
    return addresses


def test_the_own_name_has_to_lead_here_also_for_the_masters_pc(names):
    for own, master, state, says in (
        ({"10.42.0.1"}, {"10.42.0.1"}, OK, "nodes here register as pc (the host name)"),
        ({"127.0.1.1"}, {"127.0.0.1"}, OK, ""),
        ({"10.42.0.1"}, {"10.42.0.9"}, OK, ""),
        ({"127.0.1.1"}, {"10.42.0.9"}, FAIL, "the master's PC would connect to itself (127.0.1.1)"),
        ({"10.42.0.7"}, {"10.42.0.1"}, FAIL, "which leads to 10.42.0.7: not this PC"),
        (set(), {"10.42.0.1"}, FAIL, "cannot be resolved"),
    ):
        names["pc"], names["master"] = own, master
        finding = graph.check_own_name(OWN)
        assert finding.state == state and says in finding.text
        if state == FAIL:
            assert finding.remedy[-1].endswith("export ROS_IP=10.42.0.1")
            assert len(finding.remedy) == (1 if master == {"10.42.0.9"} else 2)


def test_variables_that_hide_or_name_another_address_are_told(names, monkeypatch):
    for variables, own, state, says in (
        ({}, OWN, OK, "ROS_IP -, ROS_HOSTNAME -"),
        ({"ROS_IP": "10.42.0.1"}, OWN, OK, "ROS_IP 10.42.0.1"),
        ({"ROS_IP": "127.0.0.1"}, OWN, OK, ""),
        ({"ROS_IP": "10.42.0.7"}, OWN, FAIL, "which is not an address of this PC"),
        ({"ROS_IP": "10.42.0.7"}, None, OK, ""),
        ({"ROS_IP": "10.42.0.1", "ROS_HOSTNAME": ""}, OWN, WARN, "set but empty"),
        ({"ROS_IP": "10.42.0.1", "ROS_HOSTNAME": "pc"}, OWN, WARN, "takes precedence"),
        ({"ROS_HOSTNAME": "pc"}, OWN, OK, "ROS_HOSTNAME pc"),
    ):
        for name in ("ROS_IP", "ROS_HOSTNAME"):
            monkeypatch.delenv(name, raising=False)
        for name, value in variables.items():
            monkeypatch.setenv(name, value)
        finding = graph.check_variables(own)
        assert finding.state == state and says in finding.text, variables


def test_a_master_that_does_not_answer_is_started_here_or_looked_for_there(names, monkeypatch):
    monkeypatch.setattr(graph, "ask_master", lambda call: 7)
    assert graph.check_master(OWN) == (OK, "answers at http://master:11311", ())

    def refuse(call):
        raise NodeError("no answer")

    monkeypatch.setattr(graph, "ask_master", refuse)
    for address, remedy in (("10.42.0.1", "roslaunch hero_bringup"), ("10.42.0.9", "ping master")):
        names["master"] = {address}
        finding = graph.check_master(OWN)
        assert (finding.state, finding.text) == (FAIL, "no answer") and remedy in finding.remedy[0]
    names["master"] = set()
    assert "the name master cannot be resolved" in graph.check_master(OWN).text


def make_report(*states, stopped=False, listening="10.42.0.1:11411"):
    rows = [
        Robot(id=number, namespace="/hero_%d" % number, state=state, address="a", firmware="v3.8")
        for number, state in enumerate(states)
    ]
    return RobotArray(robots=rows, stopped=stopped, listening=listening)


def test_robots_that_cannot_be_driven_are_told_with_their_remedy():
    text, lines = describe_report("/lab", make_report(Robot.READY, Robot.AWAY, stopped=True))
    assert text == "/lab: 0 of 2 robots ready, 1 stopped, 1 lost, the driver listens on 10.42.0.1:11411, firmware v3.8"
    assert lines == [
        "all robots are stopped before the driver's start; to release them: rosservice call /lab/stop false",
        "/hero_1 at a is AWAY",
    ]
    report = make_report(Robot.READY, Robot.READY)
    report.robots[1].firmware = "v3.7"
    assert describe_report("/lab", report)[1] == ["firmware differs: v3.7 (1); v3.8 (0)"]
    report = make_report(Robot.READY)
    report.gone = [Robot(id=number) for number in (7, 3)]
    text, lines = describe_report("/lab", report)
    assert text.startswith("/lab: 1 of 3 robots ready, 2 lost")
    assert lines == ["3, 7 gone: switch them on, or list them no longer: rosservice call /lab/dismiss_gone"]
    assert describe_report("/d", make_report(Robot.READY))[1] == []
    for listening, remedy in (
        ("127.0.0.1:11411", "host:=0.0.0.0"),
        ("10.42.0.1:11411", "robots must be on"),
        ("", "robots must be on"),
    ):
        (line,) = describe_report("/d", make_report(listening=listening))[1]
        assert remedy in line


@pytest.fixture(name="node")
def make_node(monkeypatch):
    made = SimpleNamespace(now_s=100.0, connects_s=0.0, subscribers=["/rosout"], reports={}, silent=[])
    time = SimpleNamespace(
        monotonic=lambda: made.now_s, sleep=lambda duration_s: setattr(made, "now_s", made.now_s + duration_s)
    )
    monkeypatch.setattr(points, "time", time)
    monkeypatch.setattr(graph, "ask_master", lambda call: ([], [["/rosout", made.subscribers]], []))

    class ScriptedDrivers:
        is_settled = property(lambda self: not made.silent)
        find_silent, read_each = (lambda self: made.silent), (lambda self: made.reports)

    monkeypatch.setattr(graph, "Drivers", ScriptedDrivers)
    publisher = SimpleNamespace(get_num_connections=lambda: int(made.now_s >= 100.0 + made.connects_s))
    monkeypatch.setattr(graph.rospy, "init_node", create_autospec(graph.rospy.init_node))
    monkeypatch.setattr(graph.rospy, "get_name", lambda: "/hero_check")
    advertise = create_autospec(graph.rospy.Publisher, return_value=publisher)
    monkeypatch.setattr(graph.rospy, "Publisher", advertise)
    made.own = OwnNode()
    return made


def test_the_way_back_is_tried_and_a_firewall_suspected(node):
    assert node.own.start().state == OK
    graph.rospy.init_node.assert_called_once_with(
        "hero_check", anonymous=True, disable_signals=True, disable_rosout=True
    )
    graph.rospy.Publisher.assert_called_once_with("/rosout", graph.Log, queue_size=1)
    node.connects_s = CONNECT_TIMEOUT_S - 0.1
    assert node.own.check_return_path().state == OK and node.now_s == pytest.approx(100.0 + CONNECT_TIMEOUT_S, abs=0.13)
    node.now_s, node.connects_s = 100.0, 99.0
    finding = node.own.check_return_path()
    assert (
        finding.state == FAIL
        and "did not connect to it within 3.0 s" in finding.text
        and "firewall" in finding.remedy[1]
    )
    assert node.now_s == pytest.approx(100.0 + CONNECT_TIMEOUT_S, abs=0.03)
    node.subscribers = []
    assert node.own.check_return_path().state == WARN


def test_every_driver_that_is_listed_has_to_report(node):
    node.own.start()
    assert (node.own.check_robots().state, node.own.check_robots().text) == (WARN, "no driver runs")
    node.reports, node.silent = {"/a": make_report(Robot.READY)}, ["/b"]
    finding = node.own.check_robots()
    assert finding.state == FAIL and finding.text == "no report comes from /b, which the ROS master lists"
    assert node.now_s == pytest.approx(100.0 + REPORT_TIMEOUT_S, abs=0.03)
    node.reports, node.silent = {"/b": make_report(Robot.READY), "/a": make_report(Robot.READY)}, []
    finding = node.own.check_robots()
    assert finding.state == OK and finding.text.startswith("/a: 1 of 1") and "; /b: 1 of 1" in finding.text
    node.reports["/b"] = make_report(*[Robot.AWAY] * (LINES_MAX + 5))
    assert node.own.check_robots().state == WARN and len(node.own.check_robots().remedy) == LINES_MAX


def test_points_that_need_one_that_failed_are_skipped(monkeypatch, capsys):
    states = {"master": OK, "node": OK, "port": OK}
    ran = []

    def run_points(names, timeout_s):
        ran.append(sorted(names))
        return {name: Finding(states.get(name, OK), name) for name in names}

    monkeypatch.setattr(check, "run_points", run_points)
    monkeypatch.setattr(network, "read_addresses", lambda: None)
    monkeypatch.setattr(network, "find_listeners", lambda port: {})
    assert check.run(check.parse_options(["--json"])) == 0
    report = json.loads(capsys.readouterr().out)
    assert (
        report["ok"]
        and len(report["points"]) == 16
        and ran[1:] == [["node"], ["commands", "diagnostics", "return_path", "robots"]]
    )
    states["node"] = FAIL
    findings = check.run_check(11411)
    assert findings["robots"] == (WARN, "skipped: needs the point node", ())
    states["master"] = FAIL
    ran.clear()
    findings = check.run_check(11411)
    assert len(ran) == 1 and findings["node"].text == "skipped: needs the point master"
    assert findings["robots"].text == "skipped: needs the point node"
    assert check.run(check.parse_options([])) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "10 OK, 5 WARN, 1 FAIL"


def test_the_interpreter_and_the_one_on_the_path_are_checked(monkeypatch):
    answers = {"/usr/bin/other": None}
    monkeypatch.setattr(computer.shutil, "which", lambda name: "/usr/bin/other")
    monkeypatch.setattr(computer, "ask_system", lambda command: answers[command[0]])
    monkeypatch.setattr(computer, "find_lacking_dependencies", dict)
    finding = computer.check_python()
    assert (
        finding.state == WARN and "/usr/bin/other, has no rospy" in finding.text and sys.executable in finding.remedy[0]
    )
    answers["/usr/bin/other"] = ""
    assert computer.check_python().state == OK
    monkeypatch.setattr(computer.shutil, "which", lambda name: sys.executable)
    assert computer.check_python().state == OK
    finder = SimpleNamespace(
        get_path=lambda name: "/ws/" + name,
        get_manifest=lambda name: SimpleNamespace(version=name.rpartition("_")[2], author=computer.AUTHOR),
    )
    monkeypatch.setattr(computer.rospkg, "RosPack", lambda: finder)
    monkeypatch.setattr(computer, "CORE", ("a_3", "b_1"))
    monkeypatch.setattr(computer, "OPTIONS", ("c_5", "d_2", "e_4", "f_1"))
    assert "several versions are mixed: 1, 2, 3, 4, 5" in computer.check_packages().text


def test_addresses_are_read_from_ip(monkeypatch):
    link = {
        "ifname": "wlan0",
        "addr_info": [{"family": "inet", "local": "10.42.0.1"}, {"family": "inet6", "local": "fe80::1"}],
    }
    loop = {"ifname": "lo", "addr_info": [{"family": "inet", "local": "127.0.0.1"}]}
    for answer, expected in ((json.dumps([link, loop]), OWN), ("", []), (None, None)):
        monkeypatch.setattr(network, "ask_system", lambda command, answer=answer: answer)
        assert network.read_addresses() == expected


def test_passwords_and_names_of_networks_end_at_their_limits(monkeypatch):
    made = []
    monkeypatch.setattr(hotspot, "choose_device", lambda wanted: ("wlan0", made[-1] if made else ""))
    monkeypatch.setattr(hotspot, "exists", lambda: False)
    calls = []
    monkeypatch.setattr(hotspot, "run_nmcli", lambda *arguments, typed="": calls.append((arguments, typed)) or "")

    def create(ssid, password, *options):
        monkeypatch.setattr(sys, "stdin", SimpleNamespace(readline=lambda: password + "\n", isatty=lambda: False))
        calls.clear()
        hotspot.main(["create", "--ssid=" + ssid, "--password-stdin", *options])
        return calls

    assert len(create("x" * 32, "y" * 8)) == len(create("ä" * 16, "y" * 63)) == 3
    for ssid, password, says in (
        ("x" * 33, "y" * 8, "must be 1 to 32 bytes"),
        ("", "y" * 7, "7 characters"),
        ("a", "y" * 64, "64 characters"),
    ):
        with pytest.raises(hotspot.HotspotError, match=says):
            create(ssid, password)
        assert calls == []
    made.append("home")
    with pytest.raises(hotspot.HotspotError, match="wlan0 is connected to 'home': --yes disconnects it"):
        create("swarm", "y" * 8)
    assert len(create("swarm", "y" * 8, "--yes")) == 3
    made.append(hotspot.CONNECTION)
    assert len(create("swarm", "y" * 8)) == 3, "its own is made anew"
    with pytest.raises(hotspot.HotspotError, match="omit --ssid"):
        create("swarm", "", "--factory")


def test_what_nmcli_says_becomes_one_line_with_a_remedy(monkeypatch):
    def answer(code, text, typed=""):
        result = SimpleNamespace(returncode=code, stdout=text.encode())
        monkeypatch.setattr(hotspot.subprocess, "run", lambda command, **options: result)
        return hotspot.run_nmcli("connection", "up", "x", typed=typed)

    assert answer(0, "a:b\n") == "a:b\n" and answer(0, "successfully updated", "save") == "successfully updated"
    for code, text, typed, words in (
        (hotspot.NMCLI_NOT_RUNNING, "", "", "NetworkManager is not running"),
        (1, "Error: Could not create NMClient object", "", "NetworkManager is not running"),
        (4, "secret typed\nError: Not authorized", "", "^Error: Not authorized: run this in a desktop session"),
        (3, "", "", "^nmcli connection up failed$"),
        (0, "Error: no such property", "save", "^Error: no such property$"),
    ):
        with pytest.raises(hotspot.HotspotError, match=words):
            answer(code, text, typed)
