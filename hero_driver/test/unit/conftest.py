"""What the unit tests share: byte captures of a real robot where they are there, vectors, no time limits."""

import os
import sys
from pathlib import Path

import hypothesis
import pytest

CAPTURES = Path(__file__).resolve().parents[3].parent / "shared" / "captures"

# The vectors of the rosserial core serve the other tests too.
sys.path.insert(0, str(Path(__file__).parent / "rosserial"))

# A busy machine is not a failure.
hypothesis.settings.register_profile(
    "patient", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("patient")


@pytest.fixture
def read_capture():
    """Return a function that reads a capture by its name, and skips the test where there is none."""
    directory = Path(os.environ.get("HERO_CAPTURES", CAPTURES))

    def read(name):
        path = directory / name
        if not path.is_file():
            pytest.skip("no capture %s; HERO_CAPTURES names the directory that holds captures" % name)
        return path.read_bytes()

    return read
