"""YAML is read, or refused in one line, whatever it is."""

import pytest

from hero_node.errors import ProgramError
from hero_node.texts import shorten
from hero_node.yaml_text import MAX_CHARACTERS, YamlError, parse_yaml, read_calibrations, read_text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[" * 1000, "deeper than can be read"),
        ("a: [", "while parsing"),
        ("a: 2020-13-45", "month must be"),
        ("a: 1\n" * MAX_CHARACTERS, "more than 500000 characters"),
        ("a: \x1b[2J", "special characters are not allowed"),
    ],
)
def test_what_is_no_yaml_is_refused_in_one_line(tmp_path, text, words):
    with pytest.raises(YamlError, match=words) as refused:
        parse_yaml(text)
    assert str(refused.value).isprintable()


def test_a_file_is_read_up_to_its_limit_and_as_utf_8_alone(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_bytes("name: Käfer".encode())
    assert parse_yaml(read_text(str(path))) == {"name": "Käfer"}
    path.write_bytes(b"\xff")
    with pytest.raises(YamlError, match="utf-8"):
        read_text(str(path))
    with pytest.raises(YamlError, match="more than 500000 characters"):
        path.write_text("x" * (MAX_CHARACTERS + 1))
        read_text(str(path))


def test_values_are_shown_in_some_words():
    endless = []
    endless.append(endless)
    for value in (endless, "x" * 10000, {number: [number] * 100 for number in range(100)}, "\x1b[2J", 10**4000):
        assert len(shorten(value)) < 200 and shorten(value).isprintable()
    assert shorten([1, 2.5, "a"]) == "[1, 2.5, 'a']"
    assert shorten([[[1]]]) == "[[[...]]]"


def test_calibrations_are_read_by_robot_but_not_those_before(tmp_path):
    (tmp_path / "hero_1.yaml").write_text("robot: hero_1\nwidth_m: 0.06\nturns: 2\n")
    (tmp_path / "hero_2.yaml").write_text("robot: hero_2\n")
    (tmp_path / "hero_3.previous.yaml").write_text("robot: hero_3\nwidth_m: {")

    def convert(width_m, content):
        return float(width_m) * content["turns"]

    assert read_calibrations(str(tmp_path), "width_m", convert) == {"hero_1": 0.12}
    assert read_calibrations("", "width_m", convert) == {}
    assert read_calibrations(str(tmp_path / "none"), "width_m", convert) == {}


@pytest.mark.parametrize("text", ["robot: hero_4\nwidth_m: wide\n", "robot: hero_4\nwidth_m: [1]\n", "{"])
def test_a_calibration_that_cannot_be_used_is_named(tmp_path, text):
    (tmp_path / "hero_4.yaml").write_text(text)
    with pytest.raises(ProgramError, match=r"hero_4.yaml: [^\n]*; correct the file, move it away"):
        read_calibrations(str(tmp_path), "width_m", lambda width_m, content: float(width_m))
