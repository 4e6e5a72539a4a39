"""Shared by all tests of pytest: markers, numpy on one core, and hypothesis without time limits, chance or memory.

A busy machine is not a failure. Every run tries the same examples, whatever earlier runs found or left behind.
"""

import importlib
import os
import sys
from pathlib import Path

import hypothesis
import hypothesis.configuration
import pytest

ROOT = Path(__file__).resolve().parent
# sources.py, which knows where packages and modules are; robots of the benchmarks. Helpers are in hero_test.
sys.path += [str(ROOT / "test"), str(ROOT / "test" / "bench")]

# Before numpy is imported: threads of OpenBLAS take turns with the tests beside, and more CPU than they save.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

hypothesis.settings.register_profile(
    "repeatable",
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.load_profile("repeatable")
# Its tables of characters; the sources stay clean.
hypothesis.configuration.set_hypothesis_home_dir(str(ROOT / ".work" / "hypothesis"))


def pytest_configure(config):
    """Define the markers."""
    config.addinivalue_line("markers", "slow: left out of the stage noetic; quicker tests call the same of libraries")
    config.addinivalue_line("markers", "option(module): needs this optional package, which the stage options has")


def pytest_runtest_setup(item):
    """Skip a test whose optional package is missing."""
    for marker in item.iter_markers("option"):
        (module,) = marker.args
        if "HERO_OPTIONS" in os.environ:
            importlib.import_module(module)
        pytest.importorskip(module, reason="the optional package %s is missing" % module.partition(".")[0])
