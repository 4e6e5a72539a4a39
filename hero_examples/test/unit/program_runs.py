"""Whole programs with their parameters on stepped robots, in virtual time."""

import contextlib
import runpy
import sys

import hero_client
from hero_sim import in_process
from hero_sim.stepped.step_clock import StepMotion


def run_main(monkeypatch, swarm, module, *arguments, duration_s=1.0):
    """Run main() of a program's module; return its result, None if it was ended after duration_s, and a log of the run.

    arguments: `_NAME:=VALUE` of its parameters.
    """
    log = swarm.log()
    monkeypatch.setattr(hero_client, "_CHOSEN", {})
    monkeypatch.setattr(sys, "argv", [module.__file__, *arguments])
    in_process.replace_ros(swarm)
    StepMotion(swarm._clock, in_process.end_at(duration_s))
    with contextlib.suppress(SystemExit):
        return runpy.run_path(module.__file__)["main"](), log
    return None, log
