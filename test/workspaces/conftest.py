"""Makes the tests' helpers importable before anything is built."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "hero_test" / "src"))
