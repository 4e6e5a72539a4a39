"""The changes of modules that change no behavior, which no test can notice: equivalent.txt.

A line holds how many changes it hides, what they are, and behind a tab why. Changes are named as script/mutants names
them; what begins with a slash is a regular expression for the rest. No line may hide more than it says, or nothing.
"""

import ast
import re
from collections import Counter
from pathlib import Path
from typing import Iterator, List, NamedTuple, Optional, Pattern, Tuple

from mutation.mutations import Mutation, list_mutations

ROOT = Path(__file__).resolve().parents[2]
FILE = Path(__file__).with_name("equivalent.txt")


class Equivalent(NamedTuple):
    """One line."""

    count: int
    pattern: Optional[Pattern[str]]  # None: the change is the text
    text: str

    def hides(self, key: str) -> bool:
        """Return whether this change is one of those of the line."""
        return bool(self.pattern.fullmatch(key)) if self.pattern else key == self.text


def read_lines() -> List[Equivalent]:
    """Return all lines."""
    found = []
    for line in FILE.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            count, key, _reason = re.fullmatch(r"(\d+) ([^\t]+)\t(.+)", line).groups()
            pattern = re.compile(key[1:]) if key.startswith("/") else None
            found.append(Equivalent(int(count), pattern, key))
    return found


def list_keys(path: Path) -> Iterator[Tuple[str, Mutation]]:
    """Yield all changes of a module, each with a name that stays, as long as its function has it."""
    seen: Counter = Counter()
    for mutation in list_mutations(ast.parse(path.read_text(encoding="utf-8"))):
        key = f"{path.relative_to(ROOT)} {mutation.describe()}"
        seen[key] += 1
        yield f"{key} #{seen[key]}", mutation


def find_wrong_lines(paths: List[Path]) -> List[str]:
    """Return what is wrong with the lines, given all modules: those that hide more or fewer changes than they say."""
    lines = read_lines()
    keys = [key for path in paths for key, _ in list_keys(path)]
    counts = [(line, sum(map(line.hides, keys))) for line in lines]
    return [f"hides {count}, not {line.count}: {line.text}" for line, count in counts if count != line.count]
