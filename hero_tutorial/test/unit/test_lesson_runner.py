"""The runner of the lessons: what it reads in a page, what it types, and what it says when a page is wrong."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import lesson_runner
from lesson_runner import Course, LessonError, PageError, clean_output, make_pattern, read_blocks


@pytest.fixture()
def try_page(tmp_path, monkeypatch):
    """Writes a page with this text and goes through it; returns the home directory."""
    home = tmp_path / "home"
    home.mkdir()
    package = tmp_path / "package"
    package.mkdir()
    (package / "one.py").write_text("print(1)\n", encoding="utf-8")
    monkeypatch.setattr(lesson_runner, "DEADLINE_S", 5.0)

    def run(text, changes=None):
        page = tmp_path / "05_page.md"
        page.write_text(text, encoding="utf-8")
        course = Course(home, package, changes or {})
        try:
            course.run_page(page)
        finally:
            course.close()
        return home

    return run


def console(*lines, marks=""):
    mark = f"<!-- lesson: {marks} -->\n" if marks else ""
    return mark + "```console\n" + "".join(line + "\n" for line in lines) + "```\n\n"


def test_a_page_that_shows_what_comes_passes(try_page):
    try_page(console("$ echo one two three", "one ... three", "$ printf 'a\\nb\\nc\\nd\\n'", "a", "...", "d"))


def test_what_differs_is_told_with_page_line_command_expected_and_got(try_page):
    text = "# Title\n\n" + console("$ echo one", "one", "$ printf 'two\\nthree\\n'", "two", "four")
    with pytest.raises(LessonError) as error:
        try_page(text)
    told = str(error.value)
    assert "05_page.md:6: $ printf" in told
    assert "expected: 05_page.md:8: four" in told
    assert "    three\n" in told


def test_a_line_that_the_page_does_not_show_is_a_difference(try_page):
    with pytest.raises(LessonError):
        try_page(console("$ printf 'one\\ntwo\\n'", "one"))


def test_a_command_that_fails_is_a_difference_unless_the_page_says_so(try_page):
    with pytest.raises(LessonError, match="exit code 3"):
        try_page(console("$ (exit 3)"))
    try_page(console("$ (exit 3)", marks="fails"))
    with pytest.raises(LessonError, match="exit code 0"):
        try_page(console("$ true", marks="fails"))


def test_a_command_that_does_not_end_is_a_difference(try_page):
    with pytest.raises(LessonError, match="still runs"):
        try_page(console("$ cat", marks="within 1 s"))


def test_a_program_shows_its_lines_and_is_then_interrupted(try_page):
    program = "$ (trap 'echo stopped; exit' INT; echo ready; while :; do sleep 0.05; done)"
    try_page(console(program, "ready", "^C", "stopped"))
    with pytest.raises(LessonError, match="expected: 05_page.md:5: halted"):
        try_page(console(program, "ready", "^C", "halted"))


def test_a_program_that_ends_before_it_is_interrupted_is_a_difference(try_page):
    with pytest.raises(LessonError, match="ended with exit code 0"):
        try_page(console("$ echo ready", "ready", "^C"))


def test_a_program_goes_on_while_another_terminal_is_used(try_page):
    text = (
        console("$ cat", marks="goes on")
        + console("$ echo beside", "beside", marks="terminal 2")
        + console("^C", "$ echo after", "after")
    )
    try_page(text)


def test_a_program_that_was_left_running_is_awaited_and_compared(try_page):
    waits = "$ until test -e ~/file; do sleep 0.05; done; echo seen"
    create = console("$ touch ~/file", marks="terminal 2")
    try_page(console(waits, marks="goes on") + create + console("seen", "$ rm ~/file"))
    with pytest.raises(LessonError, match="05_page.md:12: heard"):
        try_page(console(waits, marks="goes on") + create + console("heard"))


def test_the_runner_waits_until_a_condition_of_the_page_holds(try_page):
    create = console("$ sleep 0.5; touch ~/file; cat", marks="goes on")
    try_page(create + console("$ ls ~/file", marks="terminal 2; when test -e ~/file") + console("^C"))
    with pytest.raises(LessonError, match="did not succeed in time"):
        try_page(console("$ true", marks="when echo no >&2 && false; within 1 s"))


def test_a_terminal_remembers_directory_and_variables(try_page):
    try_page(console("$ cd /usr; x=5") + console("$ echo $PWD $x", "/usr 5"))


def test_keys_are_pressed_once_the_lines_have_come(try_page):
    try_page(
        console("$ echo name; read -r -n 1 key", "name", marks="goes on; presses w")
        + console("$ true", marks="terminal 2")
    )


def test_a_block_is_written_to_its_file_and_lines_of_a_command_belong_together(try_page):
    home = try_page(
        "<!-- lesson: file ~/some/where.txt -->\n```text\nhello\n```\n"
        + console("$ cat ~/some/where.txt <<'END'", "> nothing", "> END", "hello")
    )
    assert (home / "some" / "where.txt").read_text(encoding="utf-8") == "hello\n"


def test_a_block_that_shows_a_file_must_be_equal_to_it(try_page):
    try_page("<!-- lesson: same as one.py -->\n```python\nprint(1)\n```\n")
    with pytest.raises(LessonError, match="differs from"):
        try_page("<!-- lesson: same as one.py -->\n```python\nprint(2)\n```\n")


def test_a_block_that_is_not_run_is_not_typed_and_another_command_can_take_its_place(try_page):
    home = try_page(
        console("$ touch ~/typed", marks="not run, needs a robot")
        + console("$ sudo touch ~/root", marks="instead touch ~/other")
    )
    assert [path.name for path in home.iterdir()] == ["other"]


def test_what_differs_between_machines_is_changed_in_commands_and_in_what_is_expected(try_page):
    try_page(console("$ echo HERE", "HERE"), {"HERE": "there"})


def test_colours_titles_and_lines_that_were_written_over_are_not_compared():
    assert clean_output("\x1b[1mbold\x1b[0m\x1b]2;title\x07 \r\n10 %\r20 %\r\na\tb") == "bold\n20 %\na   b\n"


def test_an_ellipsis_stands_for_text_in_a_line_or_for_any_lines():
    import re

    assert re.fullmatch(make_pattern(["x ... y", "...", "z"]), "x 1 y\nz\n")
    assert re.fullmatch(make_pattern(["x ... y", "...", "z"]), "x 1 y\n2\n3\nz\n")
    assert not re.fullmatch(make_pattern(["x ... y"]), "x 1\ny\n")


@pytest.mark.parametrize(
    "text, told",
    [
        ("<!-- lesson: backwards -->\n```console\n$ true\n```\n", "unknown mark 'backwards'"),
        ("<!-- lesson: goes on -->\nwords\n", "a mark without a block"),
        ("```console\n$ true\n", "no end"),
        ("```console\nwords\n```\n", "idle"),
        ("<!-- lesson: instead true -->\n```console\n$ a\n$ b\n```\n", "one command"),
        ("```console\n^C\n```\n", "nothing runs"),
        ("<!-- lesson: goes on -->\n```console\n$ cat\n```\n```console\n$ true\n```\n", "busy"),
    ],
)
def test_a_page_that_cannot_be_read_is_told_with_its_line(try_page, text, told):
    with pytest.raises(PageError, match=told) as error:
        try_page(text)
    assert "05_page.md:" in str(error.value)


def test_marks_hold_for_the_next_block_only(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(console("$ a", marks="terminal 3; within 7 s") + console("$ b"), encoding="utf-8")
    first, second = read_blocks(page)
    assert (first.terminal, first.deadline_s) == (3, 7.0)
    assert second.terminal == 1
