"""pytest plugin of the stage noetic: a test function runs once, without what left_out.txt names and hypothesis repeats.

The stage proves calls of libraries; the stage unit runs all tests, with all parameters and examples.
"""

from pathlib import Path

LEFT_OUT = set(Path(__file__).with_name("left_out.txt").read_text().splitlines())


def pytest_collection_modifyitems(config, items):
    functions, kept, left_out = set(), [], []
    for item in items:
        is_known = item.function in functions or item.nodeid.partition("[")[0] in LEFT_OUT
        (left_out if is_known or is_property(item.function) else kept).append(item)
        functions.add(item.function)
    items[:] = kept
    config.hook.pytest_deselected(items=left_out)


def is_property(test):
    """Return whether hypothesis makes examples for a test."""
    return getattr(test, "is_hypothesis_test", False)
