"""pytest plugin of the stage noetic: every test runs, with few of its seeds and examples.

The stage proves the language and the versions of libraries; the stage unit runs the same tests with all of them.
"""

import collections

SEEDS_MAX = 1
EXAMPLES_MAX = 10


def pytest_collection_modifyitems(config, items):
    chosen = collections.defaultdict(set)
    kept, left_out = [], []
    for item in items:
        reduce_examples(item.function)
        seed = item.callspec.params.get("seed") if hasattr(item, "callspec") else None
        seeds = chosen[item.function]
        if seed in seeds or len(seeds) < SEEDS_MAX:
            seeds.add(seed)
            kept.append(item)
        else:
            left_out.append(item)
    items[:] = kept
    config.hook.pytest_deselected(items=left_out)


def reduce_examples(test):
    """Limit the examples of a test with @given, also where it sets their number itself."""
    settings = getattr(test, "_hypothesis_internal_use_settings", None)
    if settings is not None and settings.max_examples > EXAMPLES_MAX:
        test._hypothesis_internal_use_settings = type(settings)(settings, max_examples=EXAMPLES_MAX)
