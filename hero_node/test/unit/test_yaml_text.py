"""YAML is read, or refused in one line, whatever it is."""

import pytest

from hero_node.files.yaml_text import MAX_CHARACTERS, YamlError, parse_yaml, read_text
from hero_node.texts import shorten


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
    ids=["deep", "cut off", "no date", "long", "control characters"],
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
