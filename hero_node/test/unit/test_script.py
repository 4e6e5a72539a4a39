"""The frame of a script: one node for all of its threads, and errors with the line that they come from."""

import sys
import threading

import pytest

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
    if is_notebook:
        monkeypatch.setattr(sys, "ps1", "In : ", raising=False)  # as IPython sets it
    script.start_node()
    assert (sys.excepthook is sys.__excepthook__) == is_notebook


def test_an_error_names_the_line_of_the_script(monkeypatch, capsys, tmp_path):
    path = tmp_path / "square.py"
    path.write_text("def side():\n    raise error\n\n\nside()\n")
    monkeypatch.setattr(sys.modules["__main__"], "__file__", str(path), raising=False)
    try:
        exec(compile(path.read_text(), str(path), "exec"), {"error": HeroError("hero_0 did not move")})
    except HeroError as error:
        script._print_exception(type(error), error, error.__traceback__)
    assert capsys.readouterr().err.endswith("hero_0 did not move (square.py, line 2)\n")
