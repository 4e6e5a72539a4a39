"""docs/troubleshooting.md names messages that exist."""

import ast
import re

import pytest
import sources

PAGE = sources.ROOT / "docs" / "troubleshooting.md"
PLACEHOLDER = re.compile(r"%[-+ 0-9.*]*[sdrgfxi]")
SECTIONS = (
    "Messages of the driver",
    "Messages of the tools",
    "Messages of the simulator",
    "Messages of the examples",
)
PAGES = sources.ROOT / "hero_monitor" / "src" / "hero_monitor" / "web"
SOURCES = [path for path in sources.list_source_modules().values() if "test" not in path.parts]


def docstrings_of(tree):
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for statement in body if isinstance(body, list) else ():
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                yield id(statement.value)


def parameter_texts_of(tree):
    """Texts that describe a field of the driver's configuration, or what it may be: in driver_parameters.md."""
    makers = ("_number", "_plain", "_choice", "_make_error")
    for node in ast.walk(tree):
        names = [getattr(target, "id", "") for target in getattr(node, "targets", ())]
        if names == ["allowed"] or getattr(getattr(node, "func", None), "id", "") in makers:
            yield from (id(inner) for inner in ast.walk(node))


def read_texts(path):
    """Yield the text constants of a module that are no docstrings, with their lines."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    left_out = {*docstrings_of(tree), *parameter_texts_of(tree)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in left_out:
            yield node.lineno, node.value


def read_messages():
    """Return the messages named in the page's tables."""
    text = PAGE.read_text(encoding="utf-8")
    found = []
    for section in SECTIONS:
        part = text.split("\n## %s\n" % section)[1].split("\n## ")[0]
        for line in part.splitlines():
            if line.startswith("| `"):
                found += re.findall(r"`([^`]+)`", line.split(" | ")[0])
    return found


def make_pattern(message):
    return re.compile(".*".join(map(re.escape, message.split("..."))), re.DOTALL)


MESSAGES = read_messages()
TEXTS = {PLACEHOLDER.sub("…", text) for path in SOURCES for _, text in read_texts(path)}
TEXTS |= {path.read_text(encoding="utf-8") for path in PAGES.glob("*.js")}


@pytest.mark.parametrize("message", MESSAGES)
def test_every_message_in_the_page_exists_in_the_code(message):
    assert len(message.replace(".", "").strip()) >= 8, "too short to be found by"
    pattern = make_pattern(message)
    assert any(pattern.search(text) for text in TEXTS), "nothing prints this any more: %s" % message
