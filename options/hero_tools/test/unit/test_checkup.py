"""Points of the check: findings in order whatever hangs or breaks, ports, names, addresses."""

import socket
import subprocess
import threading
import xml.etree.ElementTree as ElementTree
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from hero_test.nonempty import nonempty
from hero_tools import check
from hero_tools.checkup import computer, graph, localization, network, points
from hero_tools.checkup.network import Address
from hero_tools.checkup.points import FAIL, OK, WARN, ask_system, ok, run_points


def test_a_point_that_hangs_or_breaks_fails_alone():
    release = threading.Event()

    def hang():
        release.wait()
        return ok("late")

    def broken():
        raise ValueError("two\nlines")

    findings = run_points({"hangs": hang, "breaks": broken, "works": lambda: ok("fine")}, 0.2)
    release.set()
    assert {name: finding.state for name, finding in findings.items()} == {"hangs": FAIL, "breaks": FAIL, "works": OK}
    assert "no answer within 0.2 s" in findings["hangs"].text
    assert "two lines" in findings["breaks"].text


def test_all_points_that_hang_share_one_time_limit(monkeypatch):
    waits_s = []

    class HungThread:
        def __init__(self, **options):
            self.start = lambda: None

        def join(self, timeout_s):
            waits_s.append(timeout_s)
            clock_s[0] += timeout_s

    clock_s = [100.0]
    monkeypatch.setattr(points.threading, "Thread", HungThread)
    monkeypatch.setattr(points.time, "monotonic", lambda: clock_s[0])
    findings = run_points({"a": list, "b": list, "c": list}, 2.0)
    assert {finding.state for finding in findings.values()} == {FAIL}
    assert sum(waits_s) == 2.0


def test_a_free_port_passes_and_one_of_another_program_is_named():
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        port = holder.getsockname()[1]
        assert network.check_port(port, network.find_listeners(port)).state == OK
        holder.listen()
        finding = network.check_port(port, network.find_listeners(port))
    assert finding.state == FAIL
    assert "taken by process" in finding.text
    assert "127.0.0.1" in finding.text
    assert any("port:=" in line for line in finding.remedy)


def test_the_suites_own_driver_is_known_behind_its_interpreter(monkeypatch):
    words = b"/usr/bin/python3\0/work/devel/lib/hero_driver/hero_driver\0__name:=hero_driver\0"
    read_bytes = create_autospec(network.Path.read_bytes, return_value=words)
    monkeypatch.setattr(network.Path, "read_bytes", read_bytes)
    finding = network.check_port(11411, {"0.0.0.0": 7})
    assert finding == (OK, "the driver listens on 0.0.0.0:11411 (process 7)", ())
    read_bytes.assert_called_once_with(network.Path("/proc/7/cmdline"))


def test_a_port_held_on_ipv6_is_seen_too():
    with socket.socket(socket.AF_INET6) as holder:
        holder.bind(("::1", 0))
        holder.listen()
        assert list(network.find_listeners(holder.getsockname()[1])) == ["::1"]


def test_the_socket_of_another_users_program_leads_to_how_to_find_it(monkeypatch):
    # ss names processes of this user alone.
    lines = "LISTEN 0 128 *:11411 *:*\nLISTEN 0 128 127.0.0.53%lo:11411 0.0.0.0:*\n"
    monkeypatch.setattr(network, "ask_system", create_autospec(network.ask_system, return_value=lines))
    listeners = network.find_listeners(11411)
    assert listeners == {"*": None, "127.0.0.53": None}
    finding = network.check_port(11411, listeners)
    assert finding.state == WARN
    assert "sudo lsof -i tcp:11411" in finding.remedy[0]


def test_a_port_is_not_called_free_where_ss_is_missing(monkeypatch):
    monkeypatch.setattr(network, "ask_system", create_autospec(network.ask_system, return_value=None))
    finding = network.check_port(11411, network.find_listeners(11411))
    assert finding == (WARN, "unknown: the command ss is missing", ("sudo apt install iproute2",))


def test_a_connection_on_the_port_is_no_listener():
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        with socket.create_connection(("127.0.0.1", port)):
            holder.close()
            assert network.find_listeners(port) == {}


def make_package(folder, name):
    folder.mkdir(parents=True)
    manifest = "<package><name>{}</name><version>1.0.0</version><description>x</description>"
    (folder / "package.xml").write_text(
        manifest.format(name) + '<maintainer email="a@b.org">m</maintainer><license>BSD</license></package>'
    )


def test_two_packages_of_one_name_in_a_workspace_are_named(tmp_path, monkeypatch):
    for place in ("hero/hero_tutorial", "mine"):
        make_package(tmp_path / "src" / place, "hero_tutorial")
    make_package(tmp_path / "src" / "hero" / "hero_msgs", "hero_msgs")
    (tmp_path / "build").mkdir()
    monkeypatch.chdir(str(tmp_path / "src" / "mine"))
    finding = computer.check_workspace()
    assert finding.state == FAIL and "two packages are called hero_tutorial" in finding.text
    assert str(tmp_path / "src" / "mine") in finding.text and "CATKIN_IGNORE" in finding.remedy[0]
    (tmp_path / "src" / "hero" / "hero_tutorial" / "CATKIN_IGNORE").write_text("")
    assert computer.check_workspace() == ok(f"2 packages in {tmp_path}, each of another name")
    monkeypatch.chdir("/")
    assert computer.check_workspace().state == OK


def test_a_package_that_hides_one_of_the_suite_is_named(monkeypatch):
    foreign = SimpleNamespace(version="0.0.0", author="me")
    own = SimpleNamespace(version="0.3.0", author=computer.AUTHOR)
    finder = SimpleNamespace(
        get_path=lambda name: "/ws/src/" + name,
        get_manifest=lambda name: foreign if name == "hero_tutorial" else own,
    )
    monkeypatch.setattr(computer.rospkg, "RosPack", lambda: finder)
    finding = computer.check_packages()
    assert finding.state == FAIL
    assert "/ws/src/hero_tutorial is another package of the name hero_tutorial" in finding.text


@pytest.mark.parametrize(("package", "state"), [("hero_swarm", WARN), ("hero_driver", FAIL)])
def test_a_module_that_a_package_declares_and_is_missing_is_named(monkeypatch, tmp_path, package, state):
    keys = "".join(f"<exec_depend>{key}</exec_depend>" for key in ("rospy", "python3-no-such", "python3-yaml"))
    head = f"<name>{package}</name><version>0.3.0</version><description>d</description><license>BSD</license>"
    maintainer = '<maintainer email="a@b.example">a</maintainer>'
    (tmp_path / "package.xml").write_text(f'<package format="3">{head}{maintainer}{keys}</package>')

    def get_path(name):
        if name != package:
            raise computer.rospkg.ResourceNotFound(name)
        return str(tmp_path)

    monkeypatch.setattr(computer.rospkg, "RosPack", lambda: SimpleNamespace(get_path=get_path))
    assert computer.find_lacking_dependencies() == {"python3-no-such": [package]}
    finding = computer.check_python()
    assert finding.state == state and f"lacks python3-no-such (for {package})" in finding.text
    assert finding.remedy[0] == "Debian: sudo apt install python3-no-such"


def test_modules_of_all_declared_packages_are_found_by_their_names():
    own = Path(computer.__file__).resolve().parents[3] / "package.xml"
    keys = [element.text for element in ElementTree.parse(str(own)).iter("exec_depend")]
    modules = [computer.MODULES.get(key, key[len("python3-") :]) for key in keys if key.startswith("python3-")]
    assert "catkin_pkg" in modules and all(map(str.isidentifier, nonempty(modules)))


@pytest.mark.parametrize("free_gb, state", [(0.19, FAIL), (0.2, WARN), (1.99, WARN), (2.0, OK)])
def test_a_disk_that_fills_is_told_also_before_a_folder_is_there(monkeypatch, tmp_path, free_gb, state):
    looked = []

    def measure(folder):
        looked.append(folder)
        return SimpleNamespace(free=free_gb * 1e9)

    monkeypatch.setattr(computer.shutil, "disk_usage", measure)
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "not" / "there"))
    finding = computer.check_disk()
    assert finding.state == state and finding.text == f"{free_gb:.1f} GB free for {tmp_path}/not/there"
    monkeypatch.delenv("ROS_HOME")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert computer.check_disk().text.endswith(f" for {tmp_path}/.ros") and looked == [str(tmp_path)] * 2


@pytest.mark.parametrize("answer, state", [("yes\n", OK), ("no\n", WARN), (None, OK)])
def test_a_clock_that_is_not_synchronized_is_told(monkeypatch, answer, state):
    monkeypatch.setattr(computer, "ask_system", lambda command: answer)
    finding = computer.check_clock()
    assert finding.state == state and ("unknown" in finding.text) == (answer is None)


WIFI, LAN, DOCKER = (
    Address("wlan0", "10.42.0.1"),
    Address("eth0", "192.168.7.2"),
    Address("docker0", "172.17.0.1"),
)


@pytest.mark.parametrize(
    ("addresses", "listening", "state", "says"),
    [
        ([LAN, WIFI], [], OK, "10.42.0.1:11411"),
        ([LAN, WIFI], ["0.0.0.0"], OK, "10.42.0.1:11411"),
        ([LAN, WIFI], ["127.0.0.1"], WARN, "open on 127.0.0.1 only"),
        ([LAN, WIFI], ["192.168.7.2"], WARN, "connect to one of these, port 11411: 192.168.7.2 (eth0)"),
        ([LAN, WIFI], ["127.0.0.1", "10.42.0.1"], OK, "10.42.0.1:11411"),
        ([LAN, WIFI], ["::"], OK, "192.168.7.2 (eth0), 10.42.0.1 (wlan0)"),
        ([LAN], [], WARN, "192.168.7.2 (eth0)"),
        ([], [], WARN, "no network"),
        (None, [], WARN, "ip is missing"),
    ],
)
def test_addresses_that_robots_can_connect_to_are_listed(addresses, listening, state, says):
    finding = network.check_addresses(addresses, 11411, listening)
    assert finding.state == state
    assert says in finding.text
    assert bool(finding.remedy) == (state != OK)


def test_no_address_is_named_where_the_driver_does_not_listen():
    finding = network.check_addresses([LAN, WIFI], 11411, ["127.0.0.1"])
    assert not any(entry.address in finding.text + " ".join(finding.remedy) for entry in (LAN, WIFI))
    assert "host:=0.0.0.0" in finding.remedy[0]


@pytest.mark.parametrize("uri", ["localhost", "http://", "http://pc:99999", "http://[::1", "ftp://pc:1", "http://pc:0"])
def test_a_bad_master_uri_is_named_with_its_value(monkeypatch, uri):
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    for finding in (graph.check_variables([]), graph.check_master([])):
        assert finding.state == FAIL
        assert repr(uri) in finding.text
        assert "http://ADDRESS:11311" in finding.text


def test_only_addresses_of_this_pc_are_its_own():
    assert network.is_own("127.0.1.1", [])
    assert network.is_own("10.42.0.1", [WIFI])
    assert not network.is_own("10.42.0.2", [WIFI])


def test_packages_that_are_not_on_the_path_are_named(monkeypatch):
    assert computer.check_packages().state == OK
    monkeypatch.setattr(computer, "OPTIONS", ("hero_tools", "hero_nowhere"))
    finding = computer.check_packages()
    assert finding.state == OK and finding.text.endswith(", without hero_nowhere")
    monkeypatch.setattr(computer, "CORE", ("hero_msgs", "hero_nowhere"))
    finding = computer.check_packages()
    assert finding.state == FAIL
    assert "hero_nowhere" in finding.text
    assert "source" in finding.remedy[0]


def test_a_camera_that_this_user_may_not_open_is_named(tmp_path, monkeypatch):
    pattern = str(tmp_path / "video*")
    assert localization.check_camera(pattern).state == OK
    (tmp_path / "video0").touch()
    assert localization.check_camera(pattern) == (OK, str(tmp_path / "video0"), ())
    monkeypatch.setattr(localization.os, "access", lambda path, mode: not path.endswith("video1"))
    (tmp_path / "video1").touch()
    finding = localization.check_camera(pattern)
    assert finding.state == WARN
    assert finding.text.endswith("may not open %s" % (tmp_path / "video1"))


def test_what_nodes_report_is_counted_and_problems_are_named():
    rate = DiagnosticStatus(name="track: camera", message="29.9 images per second, 2 tags")
    robots = [DiagnosticStatus(name="localization: hero_%d" % number, message="tracked") for number in (0, 1)]
    reports = {"track": [rate], "localization": robots}
    text = "track: 1 of 1 without a problem; localization: 2 of 2 without a problem"
    assert localization.describe_nodes(reports) == (OK, text, ())
    robots[1].level, robots[1].message = DiagnosticStatus.WARN, "not measured for 3 s"
    rate.level, rate.message = DiagnosticStatus.ERROR, "images are too dark"
    finding = localization.describe_nodes(reports)
    assert (finding.state, finding.text) == (
        WARN,
        "track: 0 of 1 without a problem; localization: 1 of 2 without a problem",
    )
    assert finding.remedy == ("track: camera: images are too dark", "localization: hero_1: not measured for 3 s")


class DiagnosticsSubscriber:
    """Hears nodes, each of which sends some of its statuses at a time."""

    sent = (
        ("/track", "camera", 0),
        ("/localization", "hero_0", 0),
        ("/track", "tags", 1),
        ("/localization", "hero_0", 2),
    )

    def __init__(self, steps, topic, kind, keep):
        assert (topic, kind) == ("/diagnostics", DiagnosticArray)
        steps.append("listen")
        self.unregister = lambda: steps.append("end")
        for node, name, level in self.sent:
            report = DiagnosticArray(status=[DiagnosticStatus(name=name, level=level, message="message")])
            report._connection_header = {"callerid": node}
            keep(report)


def test_of_each_node_all_statuses_are_told_with_the_newest_of_a_name(monkeypatch):
    steps = []
    publishers = [["/rosout", ["/track"]], ["/diagnostics", ["/track", "/localization", "/silent"]]]
    monkeypatch.setattr(localization, "ask_master", lambda question: [publishers, [], []])
    monkeypatch.setattr(localization.rospy, "Subscriber", partial(DiagnosticsSubscriber, steps))
    monkeypatch.setattr(localization, "wait_until", lambda is_done, limit_s: steps.append((is_done(), limit_s)))
    finding = localization.check_nodes()
    told = "localization: 0 of 1 without a problem; silent: 0 of 0 without a problem; track: 1 of 2 without a problem"
    assert (finding.state, finding.text) == (WARN, told)
    assert [line.partition(":")[0] for line in finding.remedy] == ["hero_0", "silent sends no diagnostics", "tags"]
    assert steps == ["listen", (False, points.REPORT_TIMEOUT_S), "end"]
    publishers.pop()
    assert localization.check_nodes() == (OK, "no node reports diagnostics", ())


def test_a_tracker_that_reports_nothing_is_named():
    finding = localization.describe_nodes({"track": []})
    assert finding.state == WARN
    assert "rosnode ping track" in finding.remedy[0]


def test_a_command_that_is_missing_fails_or_hangs_is_no_error(monkeypatch, capfd):
    assert ask_system(["no-such-command-here"]) is None
    assert ask_system(["false"]) is None
    assert ask_system(["sleep", "100"], timeout_s=0.1) is None
    assert ask_system(["echo", "yes"]) == "yes\n"
    run = create_autospec(subprocess.run, side_effect=subprocess.run)
    monkeypatch.setattr(subprocess, "run", run)
    assert ask_system(["sh", "-c", "echo $LC_ALL; echo an error >&2"]) == "C\n" and capfd.readouterr().err == ""
    assert run.call_args[1]["stdin"] == subprocess.DEVNULL, "it may ask nothing"


@pytest.mark.parametrize(("option", "words"), [("--port=0", "from 1 to 65535"), ("--color", "--color")])
def test_wrong_options_of_check_are_refused_by_name(option, words, capsys):
    with pytest.raises(SystemExit) as caught:
        check.parse_options([option])
    assert caught.value.code == 2
    assert words in capsys.readouterr().err


def test_every_tcp_port_can_be_checked():
    assert [check.parse_options(["--port", port]).port for port in ("1", "65535")] == [1, 65535]
