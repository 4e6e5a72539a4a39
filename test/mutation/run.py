"""Changes one thing at a time in the modules of a package, and counts the changes that its unit tests notice.

Usage: run.py [--sample N] [--seed N] WORK_DIR [PACKAGE ...]
The workspace must be sourced. Changed are all modules that know nothing of ROS, and of the others what unit tests run:
the rest of those is left to rostests. Every change is tried in its own process, with the tests that execute its
line, the fastest first; the sources stay as they are. Verdicts are kept in WORK_DIR, so that a run continues where the
last one ended: a change that was noticed is tried again when its module changes, one that was not also when the tests
change.
"""

import argparse
import ast
import contextlib
import hashlib
import importlib
import importlib.abc
import importlib.machinery
import json
import os
import random
import resource
import signal
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "test"))
import sources  # noqa: E402
from mutation import equivalents  # noqa: E402
from mutation.mutations import list_mutations  # noqa: E402
from mutation.reached import ReachedLines  # noqa: E402

CPU_LIMIT_FACTOR, CPU_LIMIT_LEAST_S = 5.0, 10
HANGS_S = 300
KILLED, SURVIVED, NOT_REACHED = "killed", "survived", "not reached"
NOTHING_FAILS, TESTS_FAIL = 0, 1  # exit codes of pytest


class MutatedModule(importlib.machinery.SourceFileLoader):
    """Loads one module from a changed syntax tree."""

    def __init__(self, name, path, tree):
        super().__init__(name, path)
        self._tree = tree

    def get_code(self, fullname):
        return compile(self._tree, self.path, "exec")


class MutatingFinder(importlib.abc.MetaPathFinder):
    """Finds the changed module before others find the one on disk."""

    def __init__(self, path, tree):
        self._path, self._tree = path, tree

    def find_spec(self, fullname, path=None, target=None):
        if fullname.rpartition(".")[2] not in (self._path.stem, self._path.parent.name):
            return None
        spec = importlib.machinery.PathFinder.find_spec(fullname, path, target)
        if spec is None or spec.origin is None or Path(spec.origin).resolve() != self._path:
            return None
        spec.loader = MutatedModule(fullname, spec.origin, self._tree)
        return spec


class Chosen:
    """pytest plugin: only these tests, in this order."""

    def __init__(self, tests):
        self._order = {test: index for index, test in enumerate(tests)}

    def pytest_collection_modifyitems(self, items):
        chosen = [item for item in items if item.nodeid in self._order]
        items[:] = sorted(chosen, key=lambda item: self._order[item.nodeid])


class Mutant(NamedTuple):
    """One change, by its place in the list of all of its module."""

    path: Path
    index: int
    line: int
    key: str  # the same in the next version, as long as its function has it
    tests: tuple  # those that execute it, the fastest first
    seconds: float  # of these tests


def list_packages():
    """Return the packages that have both modules and unit tests."""
    folders = [path.parents[1] for path in sources.find("test/unit")]
    return [folder.name for folder in folders if (folder / "src" / folder.name).is_dir()]


def hash_files(paths):
    """Return one hash of all files."""
    digest = hashlib.sha1()
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def fork(act):
    """Run a function in a child, a session of its own with no output, which ends with its result; return its id."""
    sys.stdout.flush()
    child = os.fork()
    if child:
        return child
    code = 3
    try:
        os.setsid()
        nothing = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(nothing, stream)
        code = act()
    finally:
        os._exit(code)


def run_pytest(paths, *plugins, options=()):
    """Run these tests in this process; return pytest's exit code."""
    arguments = ["-q", "-p", "no:cacheprovider", "-o", "timeout=0", f"--rootdir={ROOT}", *map(str, paths)]
    return int(pytest.main([*arguments, *options], plugins=list(plugins)))


def find_reached_lines(package, paths, state):
    """Return what each test executes, and the modules of others that the tests import."""
    state_hash = hash_files([*paths, *sorted((sources.PACKAGES[package] / "test" / "unit").rglob("*.py"))])
    kept, log = state / "reached.json", state / "tests.log"
    if kept.is_file():
        reached = json.loads(kept.read_text(encoding="utf-8"))
        if reached["hash"] == state_hash:
            return reached

    def measure():
        with open(log, "wb") as file:
            os.dup2(file.fileno(), 1)
        plugin = ReachedLines(map(str, paths))
        code = run_pytest([sources.PACKAGES[package] / "test" / "unit"], plugin)
        imported = [
            name
            for name, module in sys.modules.items()
            if getattr(module, "__file__", None) and not str(Path(module.__file__).resolve()).startswith(str(ROOT))
        ]
        reached = {"hash": state_hash, "tests": plugin.tests, "imported": imported}
        sys.stdout.flush()
        if code == 0:
            kept.write_text(json.dumps(reached), encoding="utf-8")
        return code

    _, status = os.waitpid(fork(measure), 0)
    if status:
        sys.exit(f"mutants: the unit tests of {package} fail as they are: {log}")
    return json.loads(kept.read_text(encoding="utf-8"))


def list_mutants(paths, reached):
    """Return all mutants of these modules."""
    tests_by_line, tests_by_path = {}, {}
    durations = {test: seconds for test, (seconds, _) in reached["tests"].items()}
    for test, (_, lines_by_path) in reached["tests"].items():
        for path, lines in lines_by_path.items():
            tests_by_path.setdefault(path, set()).add(test)
            for line in lines:
                tests_by_line.setdefault((path, line), set()).add(test)
    texts = {path: path.read_text(encoding="utf-8") for path in paths}
    files = {test: test.partition("::")[0] for test in durations}
    test_texts = {file: (ROOT / file).read_text(encoding="utf-8") for file in set(files.values())}
    pure = set(sources.list_pure_modules())
    mutants = []
    for path in texts:
        users = [other for other, its_text in texts.items() if other == path or path.stem in its_text]
        importing = set().union(*(tests_by_path.get(str(user), ()) for user in users))
        # A test that only compares constants executes no line of the module.
        importing.update(test for test, file in files.items() if path.stem in test_texts[file])
        for index, (key, mutation) in enumerate(equivalents.list_keys(path)):
            lines = range(mutation.first_line, mutation.last_line + 1)
            executing = set().union(*(tests_by_line.get((str(path), line), ()) for line in lines))
            tests = tuple(sorted(importing if mutation.at_import else executing, key=durations.get))
            seconds = sum(map(durations.get, tests))
            if tests or path in pure:
                mutants.append(Mutant(path, index, mutation.last_line, key, tests, seconds))
    return mutants


def try_mutant(mutant):
    """Run the tests with the change; return pytest's exit code. In a process of its own."""
    limit_s = int(CPU_LIMIT_FACTOR * mutant.seconds) + CPU_LIMIT_LEAST_S
    resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(HANGS_S + 10 * limit_s)
    tree = ast.parse(mutant.path.read_text(encoding="utf-8"))
    list_mutations(tree)[mutant.index].apply()
    sys.meta_path.insert(0, MutatingFinder(mutant.path, ast.fix_missing_locations(tree)))
    files = sorted({ROOT / test.partition("::")[0] for test in mutant.tests})
    return run_pytest(files, Chosen(mutant.tests), options=("-x",))


def try_all(mutants, note):
    """Try the mutants, as many at once as there are cores; note(mutant, verdict) each."""
    waiting, running = list(reversed(mutants)), {}
    try:
        while waiting or running:
            while waiting and len(running) < len(os.sched_getaffinity(0)):
                mutant = waiting.pop()
                if not mutant.tests:
                    note(mutant, NOT_REACHED)
                    continue
                running[fork(lambda mutant=mutant: try_mutant(mutant))] = mutant
            if running:
                child, status = os.wait()
                kill_session(child)
                note(running.pop(child), judge(status))
    finally:
        for child in running:
            kill_session(child)


def judge(status):
    """Return the verdict for the status of a child: killed only if a test failed; any other end is named."""
    if os.WIFSIGNALED(status):
        return "ended by " + signal.Signals(os.WTERMSIG(status)).name
    code = os.WEXITSTATUS(status)
    return {NOTHING_FAILS: SURVIVED, TESTS_FAIL: KILLED}.get(code, f"ended with status {code}")


def kill_session(child):
    """Kill what a child left behind."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)


def read_verdicts(path, tests_hash, hashes):
    """Return the verdicts of earlier runs that still hold, by the keys of the mutants."""
    rows = map(json.loads, path.read_text(encoding="utf-8").splitlines() if path.is_file() else ())
    return {
        row["key"]: row["verdict"]
        for row in rows
        if row["module"] in hashes and (row["verdict"] == KILLED or row["tests"] == tests_hash)
    }


def try_package(package, work_dir, sample, seed):
    """Try a package; return how many mutants it has, and [(mutant, verdict), ...] of those tried."""
    state = work_dir / package
    state.mkdir(parents=True, exist_ok=True)
    found = (sources.PACKAGES[package] / "src").rglob("*.py")
    # What lies in no package is no module: it is read as the files of users are, and would stay as it is.
    paths = sorted(path for path in found if path.name != "__init__.py" and path.with_name("__init__.py").is_file())
    reached = find_reached_lines(package, paths, state)
    for name in reached["imported"]:
        with contextlib.suppress(Exception):  # only saves the children time
            importlib.import_module(name)
    lines = equivalents.read_lines()
    mutants = [mutant for mutant in list_mutants(paths, reached) if not any(line.hides(mutant.key) for line in lines)]
    chosen = random.Random(seed).sample(mutants, min(sample or len(mutants), len(mutants)))
    hashes = {path: hash_files([path]) for path in paths}
    verdicts = read_verdicts(state / "tried.jsonl", reached["hash"], set(hashes.values()))
    with open(state / "tried.jsonl", "a", encoding="utf-8") as kept:

        def note(mutant, verdict):
            verdicts[mutant.key] = verdict
            row = {"key": mutant.key, "verdict": verdict, "module": hashes[mutant.path], "tests": reached["hash"]}
            kept.write(json.dumps(row) + "\n")
            kept.flush()

        try_all([mutant for mutant in chosen if mutant.key not in verdicts], note)
    return len(mutants), [(mutant, verdicts[mutant.key]) for mutant in chosen]


def print_package(package, total, results):
    """Print the row of a package, and what survived."""
    counts = {verdict: [found for _, found in results].count(verdict) for verdict in (KILLED, SURVIVED, NOT_REACHED)}
    others = len(results) - sum(counts.values())
    score = 100.0 * counts[KILLED] / max(len(results), 1)
    print(
        f"| {package} | {len(results)} of {total} | {counts[KILLED]} | {counts[SURVIVED]}"
        f" | {counts[NOT_REACHED]} | {others} | {score:.0f} % |"
    )
    for mutant, verdict in sorted(results, key=lambda result: (result[0].path, result[0].line)):
        if verdict != KILLED:
            print(f"    {mutant.path.relative_to(ROOT)}:{mutant.line}: {verdict}: {mutant.key.partition(' ')[2]}")
    sys.stdout.flush()


def main():
    """Run from the command line."""
    packages = list_packages()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # its children are sessions of their own
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("work_dir", type=Path)
    parser.add_argument("packages", nargs="*", metavar="PACKAGE", help=", ".join(packages))
    parser.add_argument("--sample", type=int, default=0, help="how many changes of each package (all)")
    parser.add_argument("--seed", type=int, default=0, help="of the sample (0)")
    options = parser.parse_intermixed_args()
    unknown = sorted(set(options.packages) - set(packages))
    if unknown:
        parser.error(f"no unit tests in {', '.join(unknown)}; there are: {', '.join(packages)}")
    print("| package | mutants tried | killed | survived | not reached | others | score |\n" + 7 * "|---" + "|")
    for package in options.packages or packages:
        print_package(package, *try_package(package, options.work_dir, options.sample, options.seed))


if __name__ == "__main__":
    main()
