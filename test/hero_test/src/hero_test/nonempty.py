"""Loops of tests that must not be over nothing."""

from typing import Iterable, Iterator, TypeVar

T = TypeVar("T")


def nonempty(items: Iterable[T]) -> Iterator[T]:
    """Yield the items one by one; fail at the end if there were none: a loop over nothing asserts nothing."""
    is_empty = True
    for item in items:
        is_empty = False
        yield item
    assert not is_empty, "a loop of this test is over nothing"


def maybe_empty(items: Iterable[T]) -> Iterable[T]:
    """Return the items, of which one round of a loop may have none, as those around it assert enough."""
    return items
