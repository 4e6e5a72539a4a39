"""Texts of others, made fit for one line of a terminal."""

from hero_node.texts import list_names, make_printable, one_line, shorten, suggest


def test_of_many_names_only_how_many_more_there_are_is_told():
    assert list_names(["a", "b"], 2) == "a, b"
    assert list_names(["a", "b", "c", "d"], 2) == "a, b and 2 more"
    assert list_names([str(number) for number in range(11)]).endswith("9 and 1 more")


def test_no_text_of_others_controls_the_terminal():
    assert make_printable("a\x1b[2J\nb") == "a?[2J?b"
    assert one_line(ValueError("a\n  b\x1b")) == "a b?"
    assert shorten("\x1b" * 100).isprintable() and len(shorten(list(range(10000)))) < 80


def test_a_name_that_is_spelled_alike_is_suggested():
    assert suggest("nominl", ["usual", "nominal", "normal"]) == "; did you mean nominal?"
    assert suggest("rate", iter(("rate_hz", "seed")), "~") == "; did you mean ~rate_hz?"
    assert suggest("xyzzy", ["usual", "nominal"]) == suggest(None, []) == ""
