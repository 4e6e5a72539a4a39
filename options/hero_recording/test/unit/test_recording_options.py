"""Options of record that are wrong: each is refused by name."""

import os
import re
import sys
from unittest.mock import create_autospec

import pytest

from hero_recording import record
from hero_recording.errors import RecordingError


@pytest.mark.parametrize(
    ("option", "value", "words"),
    [
        ("--split-mb", "0", "must be a whole number from 1 to 100000"),
        ("--split-mb", "100001", "must be a whole number from 1 to 100000"),
        ("--max-files", "-1", "must be a whole number from 0 to 10000"),
        ("--max-files", "10001", "must be a whole number from 0 to 10000"),
        ("--min-free-mb", "-1", "must be a number from 0 to 1000000000"),
        ("--min-free-mb", "1000000001.0", "must be a number from 0 to 1000000000"),
        ("--seconds", "0", "must be more than 0"),
        ("--name", "../x", "must be letters"),
        ("--topics", "(", "not a regular expression"),
        ("--robots", "one", "'one'"),
        ("--seconds", "inf", "must be more than 0"),
        ("--seconds", "nan", "must be more than 0"),
    ],
)
def test_a_wrong_option_is_refused_with_its_name_and_value(option, value, words, capsys):
    with pytest.raises(SystemExit) as caught:
        record.parse_options(["%s=%s" % (option, value)])
    assert caught.value.code == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert option in line and value in line and words in line


def test_remappings_are_the_recorders(monkeypatch, tmp_path):
    words = ["--seconds=3", "__name:=my_record", "--name=a", "/tf:=/other", f"--folder={tmp_path}"]
    monkeypatch.setattr(sys, "argv", ["record", *words])
    monkeypatch.setattr(record, "check_master", lambda: None)
    ran = []
    monkeypatch.setattr(record.Recording, "run", lambda recording: ran.append(recording))
    monkeypatch.setattr(record.roslib.packages, "find_node", lambda package, name: ["/opt/record"])
    assert record.main() == 0
    assert ran[0]._options.seconds == 3.0 and ran[0]._options.name == "a"
    assert ran[0]._command[-2:] == ["__name:=my_record", "/tf:=/other"]


@pytest.mark.parametrize(("files", "status"), [(["a.bag", "b.bag"], 0), (["a.bag", "text.bag", "b.bag"], 1)])
def test_a_file_that_cannot_be_repaired_is_named_and_others_are(files, status, monkeypatch, capsys):
    def repair(path):
        if path == "text.bag":
            raise RecordingError("text.bag cannot be repaired")
        return "repaired " + path

    monkeypatch.setattr(record, "repair_bag", create_autospec(record.repair_bag, side_effect=repair))
    monkeypatch.setattr(record, "check_master", None)  # no ROS master is needed
    monkeypatch.setattr(sys, "argv", ["record", "--repair", *files])
    assert record.command_line.call(record.main) == status
    shown = capsys.readouterr()
    assert shown.out.splitlines() == ["record: repaired a.bag", "record: repaired b.bag"]
    assert ("text.bag cannot be repaired" in shown.err) == bool(status)


def test_the_ends_of_what_options_may_be_are_allowed():
    lowest = ["--split-mb=1", "--max-files=0", "--min-free-mb=0.0", "--seconds=0.001"]
    highest = ["--split-mb=100000", "--max-files=10000", "--min-free-mb=1e9"]
    for words in (lowest, highest):
        parsed = record.parse_options(words)
        for word in words:
            name, _, value = word[2:].partition("=")
            assert getattr(parsed, name.replace("-", "_")) == float(value)


def test_without_options_the_defaults_are_those_of_the_help(capsys):
    defaults = record.parse_options([])
    assert defaults.folder == os.getcwd() and defaults.seconds is defaults.repair is defaults.robots is None
    with pytest.raises(SystemExit):
        record.parse_options(["--help"])
    shown = " ".join(capsys.readouterr().out.split())
    for name, text in (("split_mb", "of a file"), ("max_files", "newest N"), ("min_free_mb", "stop below this"),
                       ("name", r"NAME_DATE_0\.bag"), ("compression", "bag compression")):  # fmt: skip
        (default,) = re.findall(text + r" \((\w+)(?:: all)?\)", shown)
        assert str(getattr(defaults, name)).partition(".")[0] == default


def test_a_private_parameter_is_refused_by_name(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["record", "_foldr:=/tmp"])
    with pytest.raises(SystemExit) as caught:
        record.main()
    assert caught.value.code == 2
    assert "unrecognized arguments: _foldr:=/tmp" in capsys.readouterr().err
