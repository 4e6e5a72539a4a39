"""What the unit tests share: byte captures of a real robot where they are there, and vectors."""

import os
from pathlib import Path

import pytest

CAPTURES = Path(__file__).resolve().parents[3].parent / "shared" / "captures"


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
