"""The frame of a script: one node for all of its threads, and errors with the line that they come from."""

import signal
import sys
import threading

import pytest

from hero_node.command_line import find_line
from hero_node.errors import HeroError
from hero_node.ros import script

THREADS = 3


def test_threads_that_open_robots_at_once_start_one_node(monkeypatch):
    started, go = [], threading.Barrier(THREADS)

    def start(name, anonymous):
        is_first_to_start = not started
        started.append(name)
        assert is_first_to_start

    monkeypatch.setattr(script, "start_ros_node", start)
    monkeypatch.setattr(script, "check_master", lambda: None)
    monkeypatch.setattr(script.rospy.core, "is_initialized", lambda: bool(started))
    monkeypatch.setattr(sys, "excepthook", sys.excepthook)

    def open_robot():
        go.wait()
        script.start_node()

    threads = [threading.Thread(target=open_robot) for _ in range(THREADS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert started == ["hero_program"]


@pytest.mark.parametrize("is_notebook", [True, False])
def test_errors_of_scripts_are_one_line_and_notebooks_keep_theirs(monkeypatch, is_notebook):
    monkeypatch.setattr(script, "check_master", lambda: None)
    monkeypatch.setattr(script.rospy.core, "is_initialized", lambda: True)
    monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
    monkeypatch.setattr(threading, "excepthook", threading.excepthook)
    if is_notebook:
        monkeypatch.setattr(sys, "ps1", "In : ", raising=False)  # as IPython sets it
    script.start_node()
    assert (sys.excepthook is sys.__excepthook__) == is_notebook


def test_nodes_of_scripts_have_names_of_their_own_and_end_by_their_signals(monkeypatch):
    started, handlers = [], {}
    monkeypatch.setattr(script, "start_ros_node", lambda name, anonymous: started.append((name, anonymous)))
    monkeypatch.setattr(script.rospy.core, "is_initialized", lambda: False)
    monkeypatch.setattr(script.signal, "signal", handlers.__setitem__)
    monkeypatch.setattr(sys, "ps1", "", raising=False)
    script.start_node("walk")
    assert started == [("walk", True)] and set(handlers) == {signal.SIGTERM, signal.SIGHUP}
    for number, handle in list(handlers.items()):
        with pytest.raises(SystemExit) as end:
            handle(number, None)
        assert end.value.code == 128 + number and handlers[signal.SIGINT] == signal.SIG_IGN


def test_an_error_that_ends_a_thread_is_one_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
    monkeypatch.setattr(threading, "excepthook", threading.excepthook)
    monkeypatch.setattr(script.rospy.core, "is_initialized", lambda: True)
    monkeypatch.setattr(script, "check_master", lambda: None)
    script.start_node()
    monkeypatch.setattr(sys.modules["__main__"], "__file__", __file__, raising=False)
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", None)

    def fail():
        raise HeroError("hero_0 did not move")

    thread = threading.Thread(target=fail)
    thread.start()
    thread.join()
    (line,) = capsys.readouterr().err.splitlines()
    assert "hero_0 did not move (test_script.py, line " in line


def run_lesson(monkeypatch, capsys, tmp_path, *words, arguments=()):
    """Run a script that prints what it is started with; return its exit status, output and errors."""
    path = tmp_path / "lesson.py"
    path.write_text('"""Counts to three."""\nimport sys\nprint(__name__, sys.argv[1:])\n')
    monkeypatch.setattr(sys, "argv", ["lesson.py", *words])
    with pytest.raises(SystemExit) as end:
        script.run_script("hero_tutorial", str(path), arguments)
    return (end.value.code, *capsys.readouterr())


def test_a_script_of_plain_rospy_prints_its_docstring_for_help(monkeypatch, capsys, tmp_path):
    status, output, errors = run_lesson(monkeypatch, capsys, tmp_path, "--help")
    assert (status, errors) == (0, "")
    assert output.startswith("usage: rosrun hero_tutorial lesson.py") and "Counts to three." in output


def test_a_script_of_plain_rospy_refuses_arguments_it_does_not_take(monkeypatch, capsys, tmp_path):
    status, output, errors = run_lesson(monkeypatch, capsys, tmp_path, "--unknown", "_robot:=1")
    assert (status, output) == (2, "")
    assert errors.endswith("lesson.py: error: unrecognized arguments: --unknown\n")


def test_a_script_of_plain_rospy_ends_in_one_line_without_a_master(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    status, output, errors = run_lesson(monkeypatch, capsys, tmp_path)
    assert (status, output) == (1, "")
    assert errors.startswith("lesson.py: no ROS master at 'http://127.0.0.1:1'") and errors.count("\n") == 1


def test_a_script_of_plain_rospy_runs_as_the_main_module(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(script, "check_master", lambda: None)
    assert run_lesson(monkeypatch, capsys, tmp_path, "_x:=1") == (0, "__main__ ['_x:=1']\n", "")


def test_a_module_that_a_script_lacks_is_named_in_one_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(script, "check_master", lambda: None)
    monkeypatch.setitem(sys.modules, "sys", None)  # what the script imports
    status, output, errors = run_lesson(monkeypatch, capsys, tmp_path)
    assert (status, output) == (1, "")
    assert errors.startswith("lesson.py: import of sys halted") and "script/bootstrap" in errors


def test_a_script_with_arguments_needs_no_master(monkeypatch, capsys, tmp_path):
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    words = ("a.bag", "/odom")
    answer = run_lesson(monkeypatch, capsys, tmp_path, *words, arguments=("BAG", "TOPIC"))
    assert answer == (0, "__main__ ['a.bag', '/odom']\n", "")


def test_an_error_names_the_line_of_the_script(monkeypatch, capsys, tmp_path):
    path = tmp_path / "square.py"
    path.write_text("def side():\n    raise error\n\n\nside()\n")
    monkeypatch.setattr(sys.modules["__main__"], "__file__", str(path), raising=False)
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", None)
    try:
        exec(compile(path.read_text(), str(path), "exec"), {"error": HeroError("hero_0 did not move")})
    except HeroError as error:
        script._print_exception(type(error), error, error.__traceback__)
    assert capsys.readouterr().err.endswith("hero_0 did not move (square.py, line 2)\n")


def test_the_line_of_an_error_in_a_program_of_a_package_is_not_named():
    error = HeroError("no")
    try:
        raise error
    except HeroError:
        assert find_line(error) == "" and find_line(error, __file__).startswith(" (test_script.py, line ")
