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
CAPTURES = Path(os.environ.get("HERO_CAPTURES", ROOT.parent / "shared" / "captures"))
"""Bytes of a real robot, a second opinion which is no part of this repository; simulated robots give the first."""

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
    config.addinivalue_line("markers", "slow: takes 0.2 s of CPU or more; left out of the stage noetic")
    config.addinivalue_line("markers", "option(module): needs this optional package, which the stage options has")


def pytest_collection_modifyitems(config, items):
    """Leave out the tests that need captures where there are none."""
    needing = [item for item in items if "read_capture" in item.fixturenames]
    left_out = [] if CAPTURES.is_dir() else needing
    items[:] = [item for item in items if item not in left_out]
    config.hook.pytest_deselected(items=left_out)


@pytest.fixture(scope="session")
def read_capture():
    """Return a function that reads a capture by its name."""
    return lambda name: (CAPTURES / name).read_bytes()


def pytest_runtest_setup(item):
    """Skip a test whose optional package is missing."""
    for marker in item.iter_markers("option"):
        (module,) = marker.args
        if "HERO_OPTIONS" in os.environ:
            importlib.import_module(module)
        pytest.importorskip(module, reason="the optional package %s is missing" % module.partition(".")[0])
