"""The hotspot: what nmcli is told, what the person is told, and where the password never is.

nmcli is a scripted one here, because the answers need Wi-Fi hardware; test_hotspot_with_network_manager.py has the
real one.
"""

import io
import signal
import sys

import pytest
from scripted_nmcli import ScriptedNmcli

from hero_node import command_line
from hero_test.nonempty import nonempty
from hero_tools import hotspot

PASSWORD = "correct horse battery"


@pytest.fixture
def nmcli(tmp_path, monkeypatch):
    return ScriptedNmcli(tmp_path, monkeypatch)


class Terminal(io.StringIO):
    """Standard input where a person sits."""

    def isatty(self):
        return True


def run(monkeypatch, capsys, *arguments, typed=PASSWORD + "\n"):
    """Run the program and return exit code, output and errors; typed: None at a terminal."""
    monkeypatch.setattr(sys, "argv", ["hotspot", *arguments])
    monkeypatch.setattr(sys, "stdin", io.StringIO(typed) if typed else Terminal())
    with pytest.raises(SystemExit) as ended:
        command_line.run(hotspot.main)
    captured = capsys.readouterr()
    return ended.value.code, captured.out, captured.err


def test_create_makes_a_wpa2_access_point_at_2_4_ghz(nmcli, monkeypatch, capsys):
    code, output, errors = run(monkeypatch, capsys, "create", "--ssid", "swarm", "--password-stdin")
    assert code == 0, errors
    add, edit, up = [call for call in nmcli.read_calls() if {"add", "edit", "up"} & set(call.arguments)]
    told = " ".join(add.arguments)
    assert "ifname wlan0" in told
    assert "ssid swarm mode ap wifi.band bg" in told
    assert "key-mgmt wpa-psk wifi-sec.proto rsn wifi-sec.pairwise ccmp wifi-sec.group ccmp" in told
    assert "ipv4.method shared ipv4.addresses 10.42.0.1/24" in told
    assert edit.typed == "set wifi-sec.psk %s\nsave\nquit\n" % PASSWORD
    assert up.arguments[-2:] == ["up", "hero_hotspot"]
    assert "this network, its password, 10.42.0.1 and 11411" in output
    assert "http://192.168.4.1" in output


def test_the_password_is_on_no_command_line_nor_in_output_or_history(nmcli, monkeypatch, capsys):
    _, output, errors = run(monkeypatch, capsys, "create", "--password-stdin")
    for call in nonempty(nmcli.read_calls()):
        assert PASSWORD not in " ".join(call.arguments)
        assert not call.typed or call.home == "/dev/null"
    assert PASSWORD not in output + errors


@pytest.mark.parametrize(
    ("password", "says"),
    [
        ("short", "5 characters"),
        ("x" * 64, "64 characters"),
        ("pässwörter", "non-ASCII"),
        (" begins so", "space"),
    ],
)
def test_a_password_that_wpa2_does_not_take_is_refused_and_not_repeated(nmcli, monkeypatch, capsys, password, says):
    nmcli.answer("-f NAME connection show", 0, "hero_hotspot\n")
    code, _, errors = run(monkeypatch, capsys, "create", "--password-stdin", typed=password + "\n")
    assert code == 1
    assert says in errors
    assert password not in errors
    assert not nmcli.list_changes(), "the hotspot that there is stays"


def test_a_password_that_is_repeated_wrongly_is_refused(nmcli, monkeypatch, capsys):
    nmcli.answer("-f NAME connection show", 0, "hero_hotspot\n")
    for repeated, wanted in ((PASSWORD, 0), ("another password", 1)):
        typed = iter([PASSWORD, repeated])
        monkeypatch.setattr(hotspot.getpass, "getpass", lambda prompt, typed=typed: next(typed))
        code, _, errors = run(monkeypatch, capsys, "create", "--yes", typed=None)
        assert code == wanted and ("differ" in errors) == bool(wanted)
        assert [change[1] for change in nmcli.list_changes()] == ["delete", "add", "edit", "30"]


def test_without_a_command_the_commands_are_named(nmcli, monkeypatch, capsys):
    code, _, errors = run(monkeypatch, capsys)
    assert code == 2 and "create | status | remove" in errors


def test_without_a_terminal_the_password_is_not_guessed(nmcli, monkeypatch, capsys):
    nmcli.answer("-f NAME connection show", 0, "hero_hotspot\n")
    code, _, errors = run(monkeypatch, capsys, "create")
    assert code == 1
    assert "--password-stdin" in errors and not nmcli.list_changes()


def test_unconfigured_robots_get_the_network_that_they_look_for(nmcli, monkeypatch, capsys):
    code, output, _ = run(monkeypatch, capsys, "create", "--factory")
    assert code == 0
    assert "hero_network" in output
    assert "its password is public" in output


def test_without_nmcli_it_says_how_to_get_it(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    code, _, errors = run(monkeypatch, capsys, "create", "--factory")
    assert code == 1
    assert "nmcli is not installed" in errors
    assert len(errors.splitlines()) == 1


@pytest.mark.parametrize(
    ("part", "code", "answer", "says"),
    [
        ("device status", 8, "Error: NetworkManager is not running.\n", "NetworkManager is not running"),
        ("device status", 0, "lo:loopback:unmanaged:\n", "no Wi-Fi device"),
        ("device status", 0, "wlan0:wifi:unavailable:\n", "switched off"),
        ("device status", 0, "wlan0:wifi:unmanaged:\n", "unmanaged"),
        ("device status", 0, "wlan0:wifi:connected:home\\: up\n", "connected to 'home: up'"),
        (
            "device status",
            0,
            "wlan0:wifi:disconnected:\nwlan1:wifi:disconnected:\n",
            "--interface: wlan0, wlan1",
        ),
        ("device show", 0, "WIFI-PROPERTIES.AP:no\n", "cannot be an access point"),
        ("device show", 0, "WIFI-PROPERTIES.AP:yes\nWIFI-PROPERTIES.2GHZ:no\n", "2.4 GHz"),
        ("connection add", 4, "Error: Failed to add 'x' connection: Insufficient privileges\n", "or as root"),
        (
            "connection up",
            4,
            "Error: Connection activation failed: No suitable device found\n",
            "No suitable device",
        ),
        ("connection edit", 0, "Error: Failed to save 'hero_hotspot'\n", "Failed to save"),
    ],
)
def test_an_obstacle_is_reported_in_one_line_with_its_remedy(nmcli, monkeypatch, capsys, part, code, answer, says):
    nmcli.answer(part, code, answer)
    exit_code, output, errors = run(monkeypatch, capsys, "create", "--password-stdin")
    assert exit_code == 1
    assert says in errors
    assert len(errors.splitlines()) == 1
    assert "is on" not in output
    assert PASSWORD not in errors


def test_a_hotspot_that_cannot_be_switched_on_leaves_nothing_behind(nmcli, monkeypatch, capsys):
    nmcli.answer("connection up", 4, "Error: Connection activation failed\n")
    nmcli.answer("-f NAME connection show", 0, "hero_hotspot\n")
    run(monkeypatch, capsys, "create", "--password-stdin")
    assert nmcli.read_calls()[-1].arguments == ["connection", "delete", "hero_hotspot"]


@pytest.mark.parametrize("step", ["add", "edit", "up"])
def test_ctrl_c_leaves_no_hotspot_without_a_password(nmcli, monkeypatch, capsys, step):
    nmcli.answer("-f NAME connection show", 0, "hero_hotspot\n")
    run_nmcli = hotspot.run_nmcli

    def press(*arguments, typed=""):
        output = run_nmcli(*arguments, typed=typed)
        if step in arguments:
            raise KeyboardInterrupt
        return output

    monkeypatch.setattr(hotspot, "run_nmcli", press)
    code, output, _ = run(monkeypatch, capsys, "create", "--password-stdin")
    assert code == 128 + signal.SIGINT and "is on" not in output
    last, clearing = [call.arguments for call in nmcli.read_calls() if "-f" not in call.arguments][-2:]
    assert step in last and clearing == ["connection", "delete", "hero_hotspot"]


def test_status_prints_the_address_for_robots_and_never_the_password(nmcli, monkeypatch, capsys):
    nmcli.answer("-f NAME connection show", 0, "Wired connection 1\nhero_hotspot\n")
    code, output, _ = run(monkeypatch, capsys, "status")
    assert code == 0
    assert "hotspot 'swarm' is on (wlan0); robots connect to 10.42.0.1, port 11411" in output
    assert not [call for call in nmcli.read_calls() if {"-s", "--show-secrets"} & set(call.arguments)]


def test_status_without_a_hotspot_fails(nmcli, monkeypatch, capsys):
    assert run(monkeypatch, capsys, "status")[0] == 1


def test_remove_deletes_the_hotspot_with_its_password(nmcli, monkeypatch, capsys):
    nmcli.answer("-f NAME connection show", 0, "hero_hotspot\n")
    code, output, _ = run(monkeypatch, capsys, "remove")
    assert code == 0
    assert nmcli.read_calls()[-1].arguments == ["connection", "delete", "hero_hotspot"]
    assert "removed" in output


@pytest.mark.parametrize("ssid", ["\udcff", "\x1b[2J", "a" * 33])
def test_a_name_that_no_network_can_have_is_refused_in_one_line(nmcli, monkeypatch, capsys, ssid):
    code, _, errors = run(monkeypatch, capsys, "create", "--ssid=%s" % ssid, "--password-stdin")
    assert (code, len(errors.splitlines())) == (1, 1), errors


def test_a_password_that_is_no_text_is_refused_in_one_line(nmcli, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"\xff\xfe secret\n"), encoding="utf-8"))
    with pytest.raises(hotspot.HotspotError, match="the password is not text"):
        hotspot.main(["create", "--password-stdin"])
