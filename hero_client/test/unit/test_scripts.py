"""Scripts say why they cannot start; the public names are those that editors complete."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import hero_client


@pytest.mark.slow
@pytest.mark.parametrize("statement", ["Robot(0)", "Swarm([0, 1])", "Swarm.discover()"])
def test_a_plain_script_with_a_bad_master_uri_ends_with_one_line(monkeypatch, statement):
    monkeypatch.setenv("ROS_MASTER_URI", "localhost")
    script = "from hero_client import Robot, Swarm; %s" % statement
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, check=False)
    assert ended.returncode == 1
    (line,) = ended.stderr.decode().splitlines()
    assert "ROS_MASTER_URI is 'localhost', but must be like http://localhost:11311" in line


def test_every_public_name_is_imported_for_editors_and_on_first_use():
    # In a workspace the imported file is one that catkin writes.
    source = Path(__file__).resolve().parents[2] / "src" / "hero_client" / "__init__.py"
    tree = ast.parse(source.read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    names = {alias.name for node in block.body for alias in node.names}
    assert names == set(hero_client.__all__) == set(hero_client._MODULES)
    for name in hero_client.__all__:
        assert getattr(hero_client, name) is not None


def test_a_shell_completes_the_public_names_and_nothing_else():
    assert dir(hero_client) == sorted(hero_client.__all__)
