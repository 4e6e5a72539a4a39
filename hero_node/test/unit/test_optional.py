"""Libraries that not everyone needs: a missing one is named with the command that installs it."""

import re
import sys

import pytest

from hero_node.errors import ProgramError
from hero_node.optional import import_optional


def test_an_installed_library_is_returned():
    assert import_optional("os.path", "python3-os").join("a", "b") == "a/b"


@pytest.mark.parametrize(
    ("package", "command"),
    [("python3-none", "apt install python3-none"), ("none>=2", "%s -m pip install 'none>=2'" % sys.executable)],
)
def test_a_missing_library_is_named_with_the_command_that_installs_it(package, command, monkeypatch):
    monkeypatch.setattr("os.path.exists", lambda path: False)
    text = "none.such is missing (No module named 'none'); install it: " + command
    with pytest.raises(ProgramError, match=re.escape(text) + "$"):
        import_optional("none.such", package)


def test_a_python_that_refuses_pip_is_named_with_an_environment(monkeypatch):
    monkeypatch.setattr("os.path.exists", lambda path: path.endswith("EXTERNALLY-MANAGED"))
    monkeypatch.setattr(sys, "prefix", sys.base_prefix)
    text = "%s -m venv --system-site-packages ~/hero_venv && ~/hero_venv/bin/pip install 'none'" % sys.executable
    with pytest.raises(ProgramError, match=re.escape(text)):
        import_optional("none.such", "none")
    monkeypatch.setattr(sys, "prefix", "/another")
    with pytest.raises(ProgramError, match="-m pip install 'none'$"):
        import_optional("none.such", "none")
