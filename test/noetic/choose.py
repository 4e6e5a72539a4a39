"""Writes left_out.txt, and is the pytest plugin that notes for it which lines each test reaches, in how many seconds.

Usage: choose.py FOLDER: of what `coverage` and this plugin have noted
"""

import os
import sys
import time
from pathlib import Path

import coverage
from library_tests import sources, uses_library

LEFT_OUT = Path(__file__).with_name("left_out.txt")
HEADER = """\
# Unit tests that the stage noetic leaves out: of modules that use libraries they reach no line that others do not
# reach in less time. Written by test/noetic/choose. A new test runs until it is left out here.
"""
MIN_S = 0.001  # of a test that takes no time

begun_s = {}  # of tests


def pytest_runtest_logstart(nodeid):
    """Count all lines and CPU time from here on, those of fixtures too, to this test."""
    coverage.Coverage.current().switch_context(nodeid.partition("[")[0])
    begun_s[nodeid] = time.process_time()


def pytest_runtest_logfinish(nodeid):
    """Note how long a test took."""
    with open(os.environ["HERO_DURATIONS"], "a") as durations:
        durations.write("%r %s\n" % (time.process_time() - begun_s[nodeid], nodeid.partition("[")[0]))


def read_tests(folder):
    """Return the lines that each test reaches of modules that use libraries, and its seconds, by its name."""
    modules = sources.list_source_modules()
    files = {str(path) for path in modules.values() if uses_library(path, modules, set())}
    lines, seconds = {}, {}
    for line in (folder / "durations.txt").read_text().splitlines():
        duration, _, name = line.partition(" ")
        seconds[name] = seconds.get(name, MIN_S) + float(duration)
        lines[name] = set()
    for path in folder.glob("coverage.*"):
        data = coverage.CoverageData(str(path))
        data.read()
        for file in files & set(data.measured_files()):
            for line, names in data.contexts_by_lineno(file).items():
                for name in set(names) & lines.keys():
                    lines[name].add((file, line))
    return lines, seconds


def choose(lines, seconds):
    """Return tests that together reach all lines, first those that reach most new ones per second; none is needless."""
    chosen, missing = set(), set().union(*lines.values())
    while missing:
        best = max(lines, key=lambda name: (len(lines[name] & missing) / seconds[name], name))
        chosen.add(best)
        missing -= lines[best]
    for name in sorted(chosen, key=seconds.get, reverse=True):
        if lines[name] <= set().union(*(lines[other] for other in chosen - {name})):
            chosen.discard(name)
    return chosen


def main():
    """Run from the command line."""
    lines, seconds = read_tests(Path(sys.argv[1]))
    chosen = choose(lines, seconds)
    left_out = sorted(set(lines) - chosen)
    LEFT_OUT.write_text(HEADER + "".join(name + "\n" for name in left_out))
    print("%d tests, %.0f s; left out: %d" % (len(chosen), sum(map(seconds.get, chosen)), len(left_out)))


if __name__ == "__main__":
    main()
