"""Other values in a YAML text, whose comments stay."""

import textwrap

import pytest
import yaml

from hero_node.files.yaml_edit import replace_values

TEXT = textwrap.dedent(
    """\
    # camera over the long table

    family: 16h5  # old prints
    mounts:
      # by the ruler
      3: [0.01, 0, 90]  # bent
      4:
      - 0.0

      - 0
      - 0
      # never found again
    tags: {3: 0}

    # measured on Monday
    references:
      20: [0.5, 0.5, 90]  # by the door
    """
)
CONTENT = yaml.safe_load(TEXT)
MOUNTS = TEXT[TEXT.index("mounts:") : TEXT.index("  # never")]


def test_a_text_that_says_the_same_stays():
    assert replace_values(TEXT, CONTENT) == TEXT


@pytest.mark.parametrize(
    "changes, before, after",
    [
        ({"family": "36h11"}, "family: 16h5  # old prints\n", "family: 36h11\n"),
        ({"mounts": {3: [0.02, 0, 90], 4: [1, 2]}}, MOUNTS, "mounts:\n  3: [0.02, 0, 90]\n  4: [1, 2]\n"),
        ({"tags": {3: 1}}, "tags: {3: 0}\n", "tags: {3: 1}\n"),
        ({"mounts": {}}, MOUNTS, "mounts: {}\n"),
        ({"lens": {"px": 2, "matrix": [1.0, 0.5]}}, "door\n", "door\nlens:\n  px: 2\n  matrix: [1.0, 0.5]\n"),
    ],
)
def test_only_entries_that_differ_change_in_the_text(changes, before, after):
    assert TEXT.count(before) == 1
    assert replace_values(TEXT, {**CONTENT, **changes}) == TEXT.replace(before, after)


def test_values_of_other_lengths_change_side_by_side():
    text = "a: 1  # first\nb: {c: 1}  # second\nd:\n  e: 1  # third\n  f: 1\n"
    content = {"a": [1000, 2000], "b": {"c": 1}, "d": {"e": 1, "g": 3}, "h": 1}
    assert replace_values(text, content) == "a: [1000, 2000]\nb: {c: 1}  # second\nd: {e: 1, g: 3}\nh: 1\n"


def test_a_long_value_stays_in_one_line():
    content = {"a": [0.123456789] * 100}
    assert replace_values("a: 1\n", content) == "a: %r\n" % content["a"]


def test_a_text_of_comments_keeps_them():
    assert replace_values("# mine", {"a": [1, 2]}) == "# mine\na: [1, 2]\n"
    assert replace_values("# mine\na: 1\n", {}) == "# mine\n"


def test_values_that_are_shared_do_not_take_long():
    layers = "".join("l%d: &l%d [%s]\n" % (n, n, ", ".join(["*l%d" % (n - 1)] * 9)) for n in range(1, 30))
    text = "l0: &l0 [1]\n" + layers
    content = {**yaml.safe_load(text), "a": 1}
    assert yaml.safe_load(replace_values(text, content))["a"] == 1


@pytest.mark.parametrize(
    "text",
    [
        '{"a": 1, "b": {"c": 2}}',
        "b: &b {c: 2}\na: 1\nd: *b\n",
        "a: 1\n'b': {c: 2}\n...\n",
        "? a\n: 1\n",
        "- 1\n",
        "a: [",
        "",
    ],
)
def test_any_text_ends_with_the_values(text):
    assert yaml.safe_load(replace_values(text, {"a": [3], "b": {"c": 4}})) == {"a": [3], "b": {"c": 4}}
