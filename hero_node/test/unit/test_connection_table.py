"""Open connections by address: which address has the most, and which of its connections is the oldest."""

import pytest

from hero_node.connection_table import ConnectionTable


def make_table(*addresses):
    """Return a table with one connection of each of these, numbered from 0."""
    table = ConnectionTable()
    for number, address in enumerate(addresses):
        table.add(number, address)
    return table


def test_the_address_with_the_most_is_found_with_its_connections_in_order():
    table = make_table("a", "b", "c", "b", "a", "b")
    assert table.find_largest() == "b"
    assert table.list_connections("b") == [1, 3, 5]
    assert (table.count("b"), table.count("c"), len(table)) == (3, 1, 6)


def test_removed_connections_count_no_longer():
    table = make_table("a", "b", "b", "b")
    assert table.remove(1) and table.remove(2) and table.remove(3)
    assert table.find_largest() == "a"
    assert (table.list_connections("b"), table.count("b"), len(table)) == ([], 0, 1)


def test_a_connection_that_is_not_in_the_table_is_removed_from_nowhere():
    table = make_table("a", "a")
    assert table.remove(0)
    assert not table.remove(0) and not table.remove(7)
    assert table.count("a") == len(table) == 1


def test_addresses_without_connections_are_forgotten():
    table = ConnectionTable()
    for number in range(256):
        table.add(number, "10.0.0.%d" % number)
        assert table.count("never seen") == 0
        table.remove(number)
    assert len(table._counts) == len(table._addresses) == 0
    with pytest.raises(IndexError):
        table.find_largest()
