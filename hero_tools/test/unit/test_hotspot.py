"""The hotspot: what nmcli is told, what the person is told, and where the password never is.

nmcli is a scripted one here, because the answers need Wi-Fi hardware; test_hotspot_with_network_manager.py has the
real one.
"""

import io
import sys

import pytest
from scripted_nmcli import ScriptedNmcli

from hero_tools import hotspot

PASSWORD = "correct horse battery"


@pytest.fixture
def nmcli(tmp_path, monkeypatch):
    return ScriptedNmcli(tmp_path, monkeypatch)


def run(monkeypatch, capsys, *arguments, typed=PASSWORD + "\n"):
    """Run the program and return exit code, output and errors."""
    monkeypatch.setattr(sys, "argv", ["hotspot", *arguments])
    monkeypatch.setattr(sys, "stdin", io.StringIO(typed))
    with pytest.raises(SystemExit) as ended:
        hotspot.main()
    captured = capsys.readouterr()
    return ended.value.code, captured.out, captured.err


def test_create_makes_a_wpa2_access_point_at_2_4_ghz_that_shares_the_address_robots_dial(
    nmcli, monkeypatch, capsys
):
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
    assert "robots must join 'swarm' and dial 10.42.0.1, port 11411" in output
    assert "http://192.168.4.1" in output


def test_the_password_is_on_no_command_line_in_no_output_and_in_no_history_of_nmcli(
    nmcli, monkeypatch, capsys
):
    _, output, errors = run(monkeypatch, capsys, "create", "--password-stdin")
    for call in nmcli.read_calls():
        assert PASSWORD not in " ".join(call.arguments)
        assert not call.typed or call.home == "/dev/null"
    assert PASSWORD not in output + errors


def test_a_dry_run_prints_the_exact_commands_and_runs_none_that_changes_anything(nmcli, monkeypatch, capsys):
    code, output, _ = run(monkeypatch, capsys, "create", "--ssid", "a b", "--dry-run")
    assert code == 0
    lines = output.splitlines()
    assert lines[0].startswith(
        "nmcli connection add type wifi ifname wlan0 con-name hero_hotspot autoconnect no ssid 'a b'"
    )
    assert lines[1] == (
        'read -rs PASSWORD; printf \'%s\\n\' "set wifi-sec.psk $PASSWORD" "save" "quit"'
        " | HOME=/dev/null nmcli connection edit hero_hotspot"
    )
    assert lines[2] == "nmcli --wait 30 connection up hero_hotspot"
    assert not [call for call in nmcli.read_calls() if "connection" in call.arguments]


def test_a_dry_run_for_a_named_interface_needs_no_network_manager(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    code, output, errors = run(monkeypatch, capsys, "create", "--interface", "wlan7", "--dry-run")
    assert (code, errors) == (0, "")
    assert "ifname wlan7" in output


@pytest.mark.parametrize("band", ["a", "5GHz", "ac"])
def test_5_ghz_is_refused_with_the_reason(nmcli, monkeypatch, capsys, band):
    code, _, errors = run(monkeypatch, capsys, "create", "--band", band)
    assert code == 2
    assert "robots hear 2.4 GHz only" in errors
    assert not nmcli.read_calls()


@pytest.mark.parametrize(
    ("password", "says"),
    [
        ("short", "5 characters"),
        ("x" * 64, "64 characters"),
        ("pässwörter", "ASCII"),
        (" begins so", "space"),
    ],
)
def test_a_password_that_wpa2_does_not_take_is_refused_and_not_repeated(
    nmcli, monkeypatch, capsys, password, says
):
    code, _, errors = run(monkeypatch, capsys, "create", "--password-stdin", typed=password + "\n")
    assert code == 1
    assert says in errors
    assert password not in errors
    assert not [call for call in nmcli.read_calls() if "add" in call.arguments]


def test_without_a_terminal_the_password_is_not_guessed(nmcli, monkeypatch, capsys):
    code, _, errors = run(monkeypatch, capsys, "create")
    assert code == 1
    assert "--password-stdin" in errors


def test_unconfigured_robots_get_the_network_that_they_look_for(nmcli, monkeypatch, capsys):
    code, output, _ = run(monkeypatch, capsys, "create", "--factory")
    assert code == 0
    assert "hero_network" in output
    assert "everybody knows this password" in output


def test_without_nmcli_it_says_how_to_get_it_and_what_else_will_do(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    code, _, errors = run(monkeypatch, capsys, "create", "--factory")
    assert code == 1
    assert "nmcli is not installed" in errors
    assert len(errors.splitlines()) == 1


@pytest.mark.parametrize(
    ("part", "code", "answer", "says"),
    [
        ("device status", 8, "Error: NetworkManager is not running.\n", "NetworkManager does not run"),
        ("device status", 0, "lo:loopback:unmanaged:\n", "no Wi-Fi device"),
        ("device status", 0, "wlan0:wifi:unavailable:\n", "switched off"),
        ("device status", 0, "wlan0:wifi:unmanaged:\n", "not managed"),
        ("device status", 0, "wlan0:wifi:connected:home\\: up\n", "connected to 'home: up'"),
        (
            "device status",
            0,
            "wlan0:wifi:disconnected:\nwlan1:wifi:disconnected:\n",
            "--interface: wlan0, wlan1",
        ),
        ("device show", 0, "WIFI-PROPERTIES.AP:no\n", "cannot be an access point"),
        ("device show", 0, "WIFI-PROPERTIES.AP:yes\nWIFI-PROPERTIES.2GHZ:no\n", "2.4 GHz"),
        (
            "general permissions",
            0,
            "org.freedesktop.NetworkManager.wifi.share.protected:no\n",
            "may not share",
        ),
        ("connection add", 4, "Error: Failed to add 'x' connection: Insufficient privileges\n", "root shell"),
        (
            "connection up",
            4,
            "Error: Connection activation failed: No suitable device found\n",
            "nmcli radio wifi on",
        ),
        ("connection edit", 0, "Error: Failed to save 'hero_hotspot'\n", "Failed to save"),
    ],
)
def test_what_is_in_the_way_is_said_in_one_line(nmcli, monkeypatch, capsys, part, code, answer, says):
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


def test_show_says_what_robots_dial_and_never_the_password(nmcli, monkeypatch, capsys):
    nmcli.answer("-f NAME connection show", 0, "Wired connection 1\nhero_hotspot\n")
    code, output, _ = run(monkeypatch, capsys, "show")
    assert code == 0
    assert "hotspot 'swarm' is on, on wlan0; robots dial 10.42.0.1, port 11411" in output
    assert not [call for call in nmcli.read_calls() if {"-s", "--show-secrets"} & set(call.arguments)]


def test_show_without_a_hotspot_says_so_and_fails(nmcli, monkeypatch, capsys):
    assert run(monkeypatch, capsys, "show")[0] == 1


def test_stop_forgets_the_hotspot_with_its_password(nmcli, monkeypatch, capsys):
    nmcli.answer("-f NAME connection show", 0, "hero_hotspot\n")
    code, output, _ = run(monkeypatch, capsys, "stop")
    assert code == 0
    assert nmcli.read_calls()[-1].arguments == ["connection", "delete", "hero_hotspot"]
    assert "off" in output


@pytest.mark.parametrize("ssid", ["\udcff", "\x1b[2J", "a" * 33])
def test_a_name_that_no_network_can_have_is_refused_in_one_line(nmcli, monkeypatch, capsys, ssid):
    code, _, errors = run(monkeypatch, capsys, "create", "--ssid=%s" % ssid, "--password-stdin")
    assert (code, len(errors.splitlines())) == (1, 1), errors


def test_a_password_that_is_no_text_is_refused_in_one_line(nmcli, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"\xff\xfe secret\n"), encoding="utf-8"))
    with pytest.raises(hotspot.HotspotError, match="the password is not text"):
        hotspot.run(["create", "--password-stdin"])


def test_nmcli_that_cannot_be_executed_is_named_as_missing(monkeypatch, capsys, tmp_path):
    (tmp_path / "nmcli").write_text("no program")
    monkeypatch.setenv("PATH", str(tmp_path))
    code, _, errors = run(monkeypatch, capsys, "show")
    assert (code, len(errors.splitlines())) == (1, 1)
    assert "nmcli is not installed" in errors
