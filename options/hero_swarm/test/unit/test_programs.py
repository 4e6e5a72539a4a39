"""Programs that run without ROS, by their names and options."""

import importlib
import json
import runpy
import sys

import pytest

import hero_node
from hero_swarm import describe
from hero_swarm.behavior import Behavior
from hero_swarm.behaviors import list_names
from hero_test.nonempty import nonempty


def test_each_program_is_the_main_of_a_module(monkeypatch):
    asked = []
    monkeypatch.setattr(hero_node, "run_named", lambda *given: asked.append(given))
    runpy.run_module("hero_swarm", run_name="__main__")
    runpy.run_module("hero_swarm.__main__", run_name="imported")
    ((package, programs),) = asked
    names = "describe design fit pack phantoms report reproduce run show verify"
    assert package == "hero_swarm" and sorted(programs) == names.split()
    for module in nonempty(programs.values()):
        assert callable(importlib.import_module(f"{package}.{module}").main)


@pytest.mark.parametrize("folders", [[], ["one"], ["one", "two"]])
def test_describe_prints_all_behaviors_and_those_of_folders(folders, tmp_path, monkeypatch, capsys):
    for folder in folders:
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "rest.controller").write_text("states: [{name: rest, do: stop}]\n")
    monkeypatch.chdir(str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["describe", *folders])
    describe.main()
    described = [one["behavior"] for one in json.loads(capsys.readouterr().out)]
    assert described == [*list_names(), *(f"{folder}/rest.controller" for folder in folders)]
    monkeypatch.setattr(sys, "argv", ["describe", "--help"])
    with pytest.raises(SystemExit):
        describe.main()
    shown = capsys.readouterr().out
    assert "usage: python3 -m hero_swarm describe" in shown and "Prints the behaviors that pages may start" in shown


def test_a_behavior_without_a_step_commands_nothing():
    with pytest.raises(NotImplementedError):
        Behavior().step(None, None, None)
