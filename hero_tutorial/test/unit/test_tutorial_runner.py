"""The tutorial runner: how it parses pages and reports differences. What it types, the pages of the courses prove."""

import pytest

from hero_test.tutorial_runner import (
    Course,
    PageError,
    TutorialError,
    clean_output,
    make_pattern,
    read_blocks,
)


@pytest.fixture()
def try_page(tmp_path):
    """Writes a page with this text and runs it."""
    home = tmp_path / "home"
    home.mkdir()

    def run(text):
        page = tmp_path / "05_page.md"
        page.write_text(text, encoding="utf-8")
        course = Course(home, {})
        try:
            course.run_page(page)
        finally:
            course.close()

    return run


def console(*lines, instructions=""):
    comment = f"<!-- tutorial: {instructions} -->\n" if instructions else ""
    return comment + "```console\n" + "".join(line + "\n" for line in lines) + "```\n\n"


def test_a_difference_names_page_line_command_expected_and_actual_output(try_page):
    text = "# Title\n\n" + console("$ echo one", "one", "$ printf 'two\\nthree\\n'", "two", "four")
    with pytest.raises(TutorialError) as error:
        try_page(text)
    message = str(error.value)
    assert "05_page.md:6: $ printf" in message
    assert "expected: 05_page.md:8: four" in message
    assert "    three\n" in message


def test_an_output_line_missing_in_the_page_is_an_error(try_page):
    with pytest.raises(TutorialError):
        try_page(console("$ printf 'one\\ntwo\\n'", "one"))


def test_a_failing_command_is_an_error_unless_the_page_expects_it(try_page):
    with pytest.raises(TutorialError, match="exit status 3"):
        try_page(console("$ (exit 3)"))
    try_page(console("$ (exit 3)", instructions="fails"))
    with pytest.raises(TutorialError, match="exit status 0"):
        try_page(console("$ true", instructions="fails"))


def test_a_command_that_does_not_end_is_an_error(try_page):
    with pytest.raises(TutorialError, match="still running"):
        try_page(console("$ cat", instructions="within 1 s"))


def test_a_program_prints_its_lines_and_is_then_interrupted(try_page):
    program = "$ (trap 'kill $!; echo stopped; exit' INT; sleep 60 & echo ready; wait)"
    try_page(console(program, "ready", "^C", "stopped"))
    with pytest.raises(TutorialError, match="expected: 05_page.md:5: finished"):
        try_page(console(program, "ready", "^C", "finished"))


def test_a_program_that_ends_before_ctrl_c_is_an_error(try_page):
    with pytest.raises(TutorialError, match="ended with exit status 0"):
        try_page(console("$ echo ready", "ready", "^C"))


@pytest.mark.slow
def test_the_output_of_a_program_left_running_is_compared(try_page):
    waits = "$ until test -e ~/file; do sleep 0.05; done; echo seen"
    create = console("$ touch ~/file", instructions="terminal 2")
    try_page(console(waits, instructions="keeps running") + create + console("seen", "$ rm ~/file"))
    with pytest.raises(TutorialError, match="05_page.md:12: heard"):
        try_page(console(waits, instructions="keeps running") + create + console("heard"))


@pytest.mark.slow
def test_the_runner_waits_for_the_condition_of_a_block(try_page):
    create = console("$ sleep 0.5; touch ~/file; cat", instructions="keeps running")
    try_page(create + console("$ ls ~/file", instructions="terminal 2; when test -e ~/file") + console("^C"))
    with pytest.raises(TutorialError, match="did not succeed in time"):
        try_page(console("$ true", instructions="when echo no >&2 && false; within 1 s"))


def test_colors_titles_and_overwritten_text_are_not_compared():
    assert clean_output("\x1b[1mbold\x1b[0m\x1b]2;title\x07 \r\n10 %\r20 %\r\na\tb") == "bold\n20 %\na   b\n"


@pytest.mark.parametrize(
    "warning",
    ["commands are late by 0.3 s: this PC is busy; robots", "poses are 0.1 s old: is Wi-Fi or this PC overloaded?"],
)
def test_a_busy_pc_adds_no_line_to_the_output_of_a_page(warning):
    shown = clean_output(
        f"\x1b[33m[WARN] [1795735734.944141]: {warning}\x1b[0m\r\nback at 0\r\n[WARN] [1.0]: no ROS\r\n"
    )
    assert shown == "back at 0\n[WARN] [1.0]: no ROS\n"


def test_an_ellipsis_matches_text_in_a_line_or_any_lines():
    import re

    assert re.fullmatch(make_pattern(["x ... y", "...", "z"]), "x 1 y\nz\n")
    assert re.fullmatch(make_pattern(["x ... y", "...", "z"]), "x 1 y\n2\n3\nz\n")
    assert not re.fullmatch(make_pattern(["x ... y"]), "x 1\ny\n")


@pytest.mark.parametrize(
    "text, message",
    [
        ("<!-- tutorial: backwards -->\n```console\n$ true\n```\n", "unknown instruction 'backwards'"),
        ("<!-- tutorial: keeps running -->\nwords\n", "an instruction without a block"),
        ("```console\n$ true\n", "not closed"),
        ("```console\nwords\n```\n", "idle"),
        ("<!-- tutorial: instead true -->\n```console\n$ a\n$ b\n```\n", "one command"),
        ("```console\n^C\n```\n", "nothing is running"),
        ("<!-- tutorial: keeps running -->\n```console\n$ cat\n```\n```console\n$ true\n```\n", "busy"),
    ],
)
def test_a_page_that_cannot_be_parsed_is_reported_with_its_line(try_page, text, message):
    with pytest.raises(PageError, match=message) as error:
        try_page(text)
    assert "05_page.md:" in str(error.value)


def test_instructions_apply_to_the_next_block_only(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(console("$ a", instructions="terminal 3; within 7 s") + console("$ b"), encoding="utf-8")
    first, second = read_blocks(page)
    assert (first.terminal, first.deadline_s) == (3, 7.0)
    assert second.terminal == 1
