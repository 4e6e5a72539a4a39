"""pytest plugin of the stage noetic: every test function runs once, and without those that hypothesis repeats.

The stage proves calls of libraries; the stage unit runs the same tests with all parameters, and those with examples.
"""


def pytest_collection_modifyitems(config, items):
    functions, kept, left_out = set(), [], []
    for item in items:
        (left_out if item.function in functions or is_property(item.function) else kept).append(item)
        functions.add(item.function)
    items[:] = kept
    config.hook.pytest_deselected(items=left_out)


def is_property(test):
    """Return whether hypothesis makes examples for a test."""
    return getattr(test, "is_hypothesis_test", False)
