"""pytest plugin of the stage noetic: every test function runs once, with few examples.

The stage proves calls of libraries; the stage unit runs the same tests with all parameters and examples.
"""

EXAMPLES_MAX = 5


def pytest_collection_modifyitems(config, items):
    functions, kept, left_out = set(), [], []
    for item in items:
        reduce_examples(item.function)
        (left_out if item.function in functions else kept).append(item)
        functions.add(item.function)
    items[:] = kept
    config.hook.pytest_deselected(items=left_out)


def reduce_examples(test):
    """Limit the examples of a test with @given, also where it sets their number itself."""
    settings = getattr(test, "_hypothesis_internal_use_settings", None)
    if settings is not None and settings.max_examples > EXAMPLES_MAX:
        test._hypothesis_internal_use_settings = type(settings)(settings, max_examples=EXAMPLES_MAX)
