"""Files of users are read once, and what was read is what runs, here and in other processes."""

import errno
import os
import pickle
import sys
from unittest.mock import create_autospec

import pytest

from hero_node.files import read_file
from hero_swarm.behaviors import find_behavior
from hero_swarm.sources import Sources

BEHAVIOR = """\
from hero_swarm.behavior import Behavior
import helper
from tools import speeds

class Own(Behavior):
    v_m_s = helper.V_M_S + speeds.V_M_S

    def step(self, sensed, memory, random):
        import late
        return late.V_M_S, 0.0, memory
"""


@pytest.fixture(name="own")
def write_behavior(tmp_path):
    (tmp_path / "tools").mkdir()
    for name, text in (
        ("own.py", BEHAVIOR), ("helper.py", "V_M_S = 1.0\n"), ("tools/__init__.py", ""),
        ("tools/speeds.py", "from . import base\nV_M_S = base.V_M_S\n"), ("tools/base.py", "V_M_S = 0.5\n"),
        ("late.py", "V_M_S = 2.0\n"),
    ):  # fmt: skip
        (tmp_path / name).write_text(text)
    return tmp_path / "own.py"


def test_a_copy_runs_the_modules_as_they_were_read_first(own):
    sources = Sources()
    assert find_behavior(str(own), sources).v_m_s == 1.5
    names = ["helper.py", "own.py", "tools/__init__.py", "tools/base.py", "tools/speeds.py"]
    assert sorted(sources.list_contents(str(own.parent), [str(own)])) == [name for name in names if name != "own.py"]
    sources.complete()
    for name in names:
        (own.parent / name).write_text("raise SystemExit")
    assert find_behavior(str(own), pickle.loads(pickle.dumps(sources))).v_m_s == 1.5
    assert find_behavior(str(own), sources) is find_behavior(str(own), sources), "made once"
    with pytest.raises(ValueError, match="own.py, line 1: SystemExit"):
        find_behavior(str(own))


def test_modules_of_an_earlier_file_are_not_those_of_the_next(own, tmp_path):
    assert find_behavior(str(own)).v_m_s == 1.5
    other = tmp_path / "other"
    own.parent.joinpath("tools").rename(tmp_path / "moved")
    other.mkdir()
    (other / "tools.py").write_text("class speeds:\n    V_M_S = 1.0\n")
    for name, text in (("own.py", BEHAVIOR), ("helper.py", "V_M_S = 7.0")):
        (other / name).write_text(text)
    assert find_behavior(str(other / "own.py")).v_m_s == 8.0


def test_a_stale_pyc_never_runs_and_none_is_written(own):
    helper = own.parent / "helper.py"
    assert find_behavior(str(own)).v_m_s == 1.5
    before = os.stat(str(helper))
    helper.write_text("V_M_S = 3.0\n")
    os.utime(str(helper), ns=(before.st_atime_ns, before.st_mtime_ns))
    assert find_behavior(str(own)).v_m_s == 3.5 and not (own.parent / "__pycache__").exists()


@pytest.mark.slow
def test_a_module_that_is_imported_while_it_runs_is_refused(own, monkeypatch):
    sources = Sources()
    step = find_behavior(str(own), sources)().step
    sources.complete()
    monkeypatch.syspath_prepend(str(own.parent))
    with pytest.raises(ImportError, match="late.py is imported while it runs: import it at the top of the file"):
        step(None, None, None)


def test_modules_that_are_installed_are_not_taken_from_beside_the_file(own):
    for name in ("wsgiref", "numpy"):
        (own.parent / (name + ".py")).write_text("raise SystemExit")
    own.write_text("import wsgiref\nimport numpy.fft\n" + BEHAVIOR)
    assert find_behavior(str(own)).v_m_s == 1.5 and "wsgiref" in sys.modules


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("own.py", "x = 1\ny = (\n", "own.py, line 2: SyntaxError"),
        ("own.py", "\nimport nowhere\n", "own.py, line 2: ModuleNotFoundError: No module named 'nowhere'"),
        ("helper.py", "\n\nx = [][0]\n", "helper.py, line 3: IndexError"),
        ("helper.py", "\nx = = 1\n", "helper.py, line 2: SyntaxError"),
        ("own.py", "import sys\nsys.exit(3)\n", "own.py, line 2: SystemExit"),
        ("own.py", "import json\njson.loads('{')\n", "own.py, line 2: JSONDecodeError"),
        ("own.py", "x = '\0'\n", "own.py"),
    ],
)
def test_a_file_that_cannot_be_loaded_is_named_with_its_line(name, text, words, own):
    (own.parent / name).write_text(text)
    with pytest.raises(ValueError, match=words):
        find_behavior(str(own))


def test_a_pipe_as_behavior_is_refused_at_once(tmp_path):
    os.mkfifo(str(tmp_path / "own.py"))
    with pytest.raises(ValueError, match="no such file"):
        find_behavior(str(tmp_path / "own.py"))


def test_a_file_that_the_disk_does_not_give_is_named_with_the_reason(own, monkeypatch):
    error = PermissionError(errno.EACCES, "Permission denied")
    monkeypatch.setattr("hero_swarm.sources.read_file", create_autospec(read_file, side_effect=error))
    with pytest.raises(ValueError, match=f"behavior {own} cannot be read: Permission denied$"):
        find_behavior(str(own), Sources())
