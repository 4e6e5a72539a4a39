"""pytest plugin of the stage noetic: each test function runs once, with the first of its parameters.

The stage proves calls of libraries; the stage unit runs all parameters, and the examples of hypothesis.
"""


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
