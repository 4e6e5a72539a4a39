"""Prints the unit tests that, with all of ours that they import, use a library that ROS Noetic has older.

What uses none runs there as in the stage unit: ROS is the same, and mypy knows the standard library of Python 3.8.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test"))
import sources  # noqa: E402

LIBRARIES = {"PIL", "cv2", "matplotlib", "numpy", "pexpect", "rospkg", "scipy", "tornado", "tqdm", "yaml"}


def uses_library(path, modules, seen):
    """Return whether a module imports a library, directly or through other modules of ours."""
    seen.add(path)
    for found in sources.read_imports(path):
        other = modules.get(found.module)
        if found.top in LIBRARIES or (other and other not in seen and uses_library(other, modules, seen)):
            return True
    return False


def main():
    """Run from the command line."""
    for tests in sources.find("test/unit"):
        # A directory of tests is on the path: its modules go by their stem.
        modules = {**sources.list_source_modules(), **{path.stem: path for path in tests.rglob("*.py")}}
        for path in sorted(tests.rglob("test_*.py")):
            if uses_library(path, modules, set()):
                print(path)


if __name__ == "__main__":
    main()
