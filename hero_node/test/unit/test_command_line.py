"""A command's end: its output, one line on stderr, its exit status; each in its own process."""

import argparse
import os
import subprocess
import sys
import types

import pytest

from hero_node import command_line

HEADER = "import sys; from hero_node import command_line\n"
FEW, MANY = "print('text')", "print('text' * 100000)"
TO_ITS_END = "def main():\n    for _ in range(100): command_line.say('text')\n    print('end', file=sys.stderr)\n"


def run_python(code, stdout=subprocess.PIPE, stderr=subprocess.PIPE, script=None):
    """Run code, or a script with it; return exit status and what came on stderr."""
    # PYTHONUNBUFFERED: empty is off, so that a text stays in the buffer until the end.
    environment = dict(os.environ, PYTHONUNBUFFERED="", PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
    arguments = ["-c", HEADER + code]
    if script:
        script.write_text(HEADER + code)
        arguments = [str(script)]
    process = subprocess.Popen([sys.executable, *arguments], stdout=stdout, stderr=stderr, env=environment)
    errors = process.communicate(timeout=60.0)[1]
    return process.returncode, (errors or b"").decode()


@pytest.fixture
def closed_pipe():
    read_end, write_end = os.pipe()
    os.close(read_end)
    yield write_end
    os.close(write_end)


@pytest.fixture
def full_disk():
    with open("/dev/full", "wb") as file:
        yield file


@pytest.mark.parametrize("printing", [FEW, MANY])
def test_a_pipe_without_a_reader_ends_a_command_silently(closed_pipe, printing):
    assert run_python("command_line.run(lambda: %s)" % printing, closed_pipe) == (141, "")


@pytest.mark.parametrize("printing", [FEW, MANY])
def test_a_full_disk_as_output_is_told_in_one_line(full_disk, printing):
    status, errors = run_python("command_line.run(lambda: %s)" % printing, full_disk)
    assert (status, errors) == (1, "-c: the output cannot be written: No space left on device\n")


def test_a_full_disk_is_told_also_by_a_command_that_failed(full_disk):
    status, errors = run_python("command_line.run(lambda: print('text') or 2)", full_disk)
    assert (status, errors) == (2, "-c: the output cannot be written: No space left on device\n")


def test_help_to_a_pipe_without_a_reader_ends_silently(closed_pipe):
    code = "import argparse; command_line.run(lambda: argparse.ArgumentParser().parse_args(['--help']))"
    assert run_python(code, closed_pipe) == (141, "")


def test_work_is_finished_although_its_output_has_no_reader(closed_pipe):
    assert run_python(TO_ITS_END + "command_line.run(main)", closed_pipe) == (0, "end\n")


def test_work_goes_on_to_its_end_though_its_output_is_full(full_disk):
    status, errors = run_python(TO_ITS_END + "command_line.run(main)", full_disk)
    assert (status, errors) == (0, "-c: the output cannot be written: No space left on device\nend\n")


def test_an_expected_error_is_one_line_and_status_1_also_without_output(closed_pipe):
    code = "def main(): print('text'); raise ValueError('a reason')\ncommand_line.run(main, ValueError)"
    assert run_python(code, closed_pipe) == (1, "-c: a reason\n")
    assert run_python(code, closed_pipe, closed_pipe)[0] == 1


def test_an_expected_error_names_the_line_of_a_users_script(tmp_path):
    code = "def main():\n    int('x')\ncommand_line.run(main, ValueError)\n"
    status, errors = run_python(code, script=tmp_path / "own.py")
    assert (status, errors.endswith(" (own.py, line 3)\n")) == (1, True), errors


def test_a_file_that_cannot_be_opened_is_named_without_a_traceback():
    assert run_python("command_line.run(lambda: open('/no/file'))") == (1, "-c: /no/file: No such file or directory\n")


def test_an_unexpected_error_keeps_its_traceback():
    status, errors = run_python("command_line.run(lambda: [][0])")
    assert status == 1
    assert errors.startswith("Traceback")


@pytest.mark.parametrize(
    ("end", "status"), [("sys.exit(3)", 3), ("sys.exit()", 0), ("exec('raise KeyboardInterrupt')", 130)]
)
def test_an_end_in_between_keeps_its_exit_status(end, status):
    assert run_python("command_line.run(lambda: %s)" % end) == (status, "")


def test_names_that_are_no_text_are_printed_all_the_same():
    assert run_python(r"command_line.run(lambda: print('\udcff'))") == (0, "")


def raise_error(error):
    raise error


@pytest.mark.parametrize(
    "main, status, errors",
    [
        (lambda: None, 0, ""),
        (lambda: 3, 3, ""),
        (lambda: raise_error(ValueError("a reason")), 1, "a reason"),
        (lambda: raise_error(KeyboardInterrupt()), 130, ""),
        (lambda: sys.exit(4), 4, ""),
        (lambda: sys.exit(), 0, ""),
        (lambda: sys.exit("a text"), 1, "a text"),
        (lambda: os.listdir("/no/file"), 1, "/no/file: No such file or directory"),
        (lambda: raise_error(OSError(5, "Input/output error", "/a/file")), 1, "/a/file: Input/output error"),
        (lambda: raise_error(OSError("no number")), 1, "no number"),
        (lambda: raise_error(OSError(28, "No space left on device")), 1, "the output cannot be written: No space left"),
        (lambda: raise_error(BrokenPipeError(32, "Broken pipe")), 141, ""),
        (lambda: print("text"), 1, "the output cannot be written: No space left on device"),
        (lambda: print("text") or 2, 2, "the output cannot be written: No space left on device"),
        (lambda: command_line.say("text"), 0, "the output cannot be written: No space left on device"),
    ],
)
def test_every_end_has_its_status_and_at_most_one_line(monkeypatch, capsys, main, status, errors):
    monkeypatch.setattr(sys, "argv", ["/some/folder/program"])
    with open("/dev/full", "w", encoding="utf-8") as output:
        monkeypatch.setattr(sys, "stdout", output)
        assert command_line.call(main, ValueError) == status
        is_lost = status == 141 or errors.startswith("the output cannot be written")
        # What waits in the buffer would fail again at the end.
        assert (os.readlink(f"/proc/self/fd/{output.fileno()}") == os.devnull) == is_lost
    told = capsys.readouterr().err
    assert told.startswith("program: " + errors) if errors else not told
    assert told.count("\n") == bool(errors)


@pytest.mark.parametrize("program, name", [("/a/tool", "tool"), ("/a/hero_sim/__main__.py", "hero_sim")])
def test_errors_begin_with_the_name_of_the_program(monkeypatch, capsys, program, name):
    monkeypatch.setattr(sys, "argv", [program])
    command_line.print_error("a reason")
    assert capsys.readouterr().err == name + ": a reason\n"


def test_what_is_said_is_written_at_once(monkeypatch, tmp_path):
    with open(str(tmp_path / "output"), "w", encoding="utf-8") as output:
        command_line.say("text", output)
        command_line.say("more", output, end="")
        assert (tmp_path / "output").read_text() == "text\nmore"
    monkeypatch.setattr(sys, "stdout", None)
    command_line.say("to no one")
    assert command_line.call(lambda: 0) == 0


def test_arguments_that_a_node_does_not_know_end_it(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["node", "_rate:=3", "topic:=other"])
    command_line.check_node_arguments("hero_x", "node", "What it does.")
    for word, status in (("--help", 0), ("word", 2)):
        monkeypatch.setattr(sys, "argv", ["node", "_rate:=3", word])
        with pytest.raises(SystemExit) as ended:
            command_line.check_node_arguments("hero_x", "node", "What it does.")
        assert ended.value.code == status
    told = capsys.readouterr()
    assert "usage: rosrun hero_x node [_PARAMETER:=VALUE ...]" in told.out
    assert told.err.splitlines()[-1] == "node: error: unrecognized arguments: word"
    assert "Parameters and topics: hero_x/README.md" in told.out
    command_line.check_node_arguments("hero_x", "node", None, ["word"])
    monkeypatch.setattr(sys, "argv", ["node", "--help"])
    with pytest.raises(SystemExit):
        command_line.check_node_arguments("hero_x", "node", None, ["word"])
    assert "README" not in capsys.readouterr().out


def test_wrong_arguments_have_the_status_of_argparse():
    with pytest.raises(SystemExit) as ended:
        argparse.ArgumentParser().parse_args(["word"])
    assert ended.value.code == command_line.WRONG_ARGUMENTS


def test_the_first_argument_names_the_program_of_a_package(monkeypatch):
    ran, modules = [], {"hero_x.fit": types.SimpleNamespace(main=lambda: ran.append(sys.argv))}
    monkeypatch.setattr(command_line, "import_module", modules.get)
    monkeypatch.setattr(sys, "argv", ["__main__.py", "calibrate", "a.bag", "b.bag"])
    with pytest.raises(SystemExit) as end:
        command_line.run_named("hero_x", {"calibrate": "fit", "show": "show"})
    assert ran == [["__main__.py", "a.bag", "b.bag"]] and end.value.code == 0
    for words in ([], ["fit"]):
        monkeypatch.setattr(sys, "argv", ["__main__.py", *words])
        with pytest.raises(SystemExit, match="^python3 -m hero_x: the first argument must be one of: calibrate, show$"):
            command_line.run_named("hero_x", {"calibrate": "fit", "show": "show"})


def test_a_library_that_a_program_of_a_package_lacks_is_named(monkeypatch):
    def fail(module):
        raise ModuleNotFoundError("no", name="scipy")

    monkeypatch.setattr(command_line, "import_module", fail)
    monkeypatch.setattr(sys, "argv", ["__main__.py", "fit"])
    with pytest.raises(SystemExit, match="^python3 -m hero_x fit: scipy is missing; install python3-scipy$"):
        command_line.run_named("hero_x", {"fit": "fit"})
