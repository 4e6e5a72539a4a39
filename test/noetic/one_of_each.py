"""pytest plugin of the stage noetic: each test function runs once, with the first of its parameters.

The stage proves calls of libraries; the stage unit runs all parameters, the examples of hypothesis, and what is marked
slow: all that takes SLOW_S or more. What should be marked, too, is named at the end.
"""

import time

import pytest

SLOW_S = 0.2  # of CPU

unmarked = []


def pytest_collection_modifyitems(config, items):
    functions, kept, left_out = set(), [], []
    for item in items:
        is_known = item.function in functions or is_property(item.function)
        (left_out if is_known else kept).append(item)
        functions.add(item.function)
    items[:] = kept
    config.hook.pytest_deselected(items=left_out)


def is_property(test):
    """Return whether hypothesis makes examples for a test."""
    return getattr(test, "is_hypothesis_test", False)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_call(item):
    begin_s = time.process_time()
    yield
    duration_s = time.process_time() - begin_s
    if duration_s >= SLOW_S:
        unmarked.append((duration_s, item.nodeid))


def pytest_terminal_summary(terminalreporter):
    for duration_s, name in sorted(unmarked, reverse=True):
        terminalreporter.write_line("%.1f s of CPU, to be marked slow: %s" % (duration_s, name))
