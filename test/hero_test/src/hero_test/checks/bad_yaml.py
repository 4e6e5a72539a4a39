"""Texts at which no reader of YAML may break or hang: it refuses each in one line."""


def make_bad_yaml(key):
    """Return texts, bytes; those that are YAML have this key."""
    shared = ["&a [x, x, x, x, x, x, x, x, x, x]"]
    for name, before in zip("bcdefghi", "abcdefgh"):
        shared.append(f"&{name} [{', '.join(['*' + before] * 10)}]")
    return [
        b"[" * 1000,  # PyYAML needs a second for 3,000
        b"{a: " * 1000,
        b"\xff\xfe\x00",
        b"\x00\x1b[2J",
        *(
            f"{key}: {value}".encode()
            for value in (
                "[",
                "2020-13-45",
                "9" * 5000,
                "1\n" * 300000,
                "&a [*a]",
                "&a {b: *a}",
                "{1: 2, b: 3, 2020-01-01: 4}",
                ".inf",
                f"[{', '.join(shared)}]",  # 1e9 entries, if written out
            )
        ),
    ]
