"""JUnit files in, one summary out; also writes the results of checks that are not tests.

Usage:
    results.py record DIR NAME EXIT_CODE    write the result of one check into DIR
    results.py record-if-none DIR NAME      write a failure into a group of DIR unless one is there
    results.py summary DIR                  print all results under DIR; exit 1 if anything failed
"""

import re
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

ERROR_LINE = re.compile(r"^(?:\w+\.)*\w*(?:Error|Exception|Expired|Failed)\b.*", re.MULTILINE)
PLACE = re.compile(r"(\w+\.py)(?:\", line |:)(\d+)")
SHOWN = 240  # characters of a reason


class Counts:
    """How many tests passed, failed and were skipped."""

    def __init__(self):
        self.passed = 0
        self.skipped = 0
        self.failures = []

    def add_file(self, path):
        """Count the test cases of one JUnit file; a file that cannot be read is a failure."""
        try:
            root = ElementTree.parse(path).getroot()
        except (ElementTree.ParseError, OSError) as error:
            self.failures.append(f"{path}: not a JUnit file: {error}")
            return
        for case in root.iter("testcase"):
            faults = [*case.findall("failure"), *case.findall("error")]
            if faults:
                title = f"{case.get('classname') or path.stem}: {case.get('name')}"
                self.failures.append(title + find_reason(faults[0]))
            elif case.find("skipped") is not None:
                self.skipped += 1
            else:
                self.passed += 1


def find_reason(fault):
    """Where a test failed and what it said, in a line that fits beside its name; empty if it said nothing."""
    text = "\n".join(filter(None, [fault.get("message"), fault.text])).strip()
    if not text:
        return ""
    places = [":".join(place) for place in PLACE.findall(text) if place[0].startswith("test_")]
    found = ERROR_LINE.search(text)
    reason = found.group() if found else text.splitlines()[0]
    return "\n    " + ": ".join([*places[-1:], reason])[:SHOWN]


def count_results(directory):
    """All results under a directory."""
    counts = Counts()
    for path in sorted(Path(directory).rglob("*.xml")):
        counts.add_file(path)
    return counts


def record(directory, name, failed):
    """Write the result of one check as a JUnit file."""
    suite = ElementTree.Element("testsuite", name=name, tests="1", failures=str(int(failed)))
    case = ElementTree.SubElement(suite, "testcase", classname=Path(directory).name, name=name)
    if failed:
        ElementTree.SubElement(case, "failure", message="see the output above")
    Path(directory).mkdir(parents=True, exist_ok=True)
    ElementTree.ElementTree(suite).write(str(Path(directory) / (name.replace(" ", "_") + ".xml")))


def print_summary(directory):
    """Print a line per group of results, what failed, and last the line `N passed, N failed`."""
    total = Counts()
    for group in sorted(path for path in Path(directory).iterdir() if path.is_dir()):
        counts = count_results(group)
        figures = f"{counts.passed:5d} passed {len(counts.failures):5d} failed {counts.skipped:5d} skipped"
        print(f"{group.name:<10}{figures}")
        total.passed += counts.passed
        total.failures += counts.failures
    for failure in total.failures:
        print(f"FAILED {failure}")
    print(f"{total.passed} passed, {len(total.failures)} failed")
    return 1 if total.failures or not total.passed else 0


def main(arguments):
    """Do what the usage above says and return the exit code."""
    command, directory = arguments[:2]
    if command == "record":
        record(directory, arguments[2], arguments[3] != "0")
    elif command == "record-if-none":
        if not count_results(directory).failures:
            record(Path(directory) / "script", arguments[2], True)
    elif command == "summary":
        return print_summary(directory)
    else:
        raise ValueError(f"unknown command {command}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
