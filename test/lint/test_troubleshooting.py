"""docs/troubleshooting.md names messages that exist, and every one of the driver and of the tools for experiments."""

import ast
import re

import pytest
import sources

PAGE = sources.ROOT / "docs" / "troubleshooting.md"
WORDS_OF_A_MESSAGE = 3
# Of the driver, but nothing that somebody has to look up: progress, names of diagnostics, patterns, parts.
NOT_LOOKED_UP = {
    "%s %s (%s)",
    "%s -> %s",
    "^Conn?ected at time (?P<millis>\\d{1,10})$",
    "%s (and %d times more before)",
    "request of service type",
    "answer of service type",
    "~host %s, ~port %d",
    "robots may move",
    "the driver ended",
    "the driver ends",
    "listening on %s, robots must dial this machine at that port",
    "%d of %d robots ready",
    "; all motion is held by ~stop",
    "frames per second",
    "bytes per second",
    "clock offset (s)",
    " is here and stays, ",
    "; did you mean ~%s?",
    "the %s wheel %s",
    "%s has a new goal",
    "all robots%s are stopped",
    "robots%s may move again",
    # Calls of the codec with values that only a mistake in the driver could make.
    "topic id %r is outside 0..65535",
    "a payload of %d bytes does not fit a frame (at most 65535)",
    "Time: %r does not fit two 32-bit numbers (%s)",
}
PLACEHOLDER = re.compile(r"%[-+ 0-9.*]*[sdrgfxi]")
SECTIONS = (
    "Messages of the driver",
    "Messages of the tools",
    "Messages of the simulator",
    "Messages of the examples",
)
TOOLS = sources.ROOT / "hero_bringup" / "src" / "hero_bringup"
COMPLAINERS = {"error", "logwarn", "logwarn_throttle", "tell"}
"""Functions that say what is wrong: argparse's, rospy's, the monitor's."""
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


def read_complaints(path):
    """Yield the texts that a tool ends with, or tells a page, with their lines."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise):
            called = node.exc
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in COMPLAINERS:
            called = node
        else:
            continue
        for inner in ast.walk(called) if called is not None else ():
            if isinstance(inner, ast.Constant) and isinstance(inner.value, str):
                yield inner.lineno, inner.value


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
TEXTS |= {path.read_text(encoding="utf-8") for path in TOOLS.glob("monitor/web/*.js")}
TOOL_TEXTS = [
    pytest.param(text, id=f"{path.name}:{line}")
    for folder in ("recording", "calibration", "monitor")
    for path in sorted((TOOLS / folder).glob("*.py"))
    if path.name != "requests.py"  # its texts are what stands in brackets where a page is told to reload
    for line, text in read_complaints(path)
    if len(text.split()) >= WORDS_OF_A_MESSAGE and text not in NOT_LOOKED_UP
]
DRIVER_TEXTS = [
    pytest.param(text, id=f"{path.name}:{line}")
    for path in SOURCES
    if sources.package_of(path) == "hero_driver"
    for line, text in read_texts(path)
    if len(text.split()) >= WORDS_OF_A_MESSAGE and text not in NOT_LOOKED_UP
]


@pytest.mark.parametrize("message", MESSAGES)
def test_every_message_in_the_page_exists_in_the_code(message):
    assert len(message.replace(".", "").strip()) >= 8, "too short to be found by"
    pattern = make_pattern(message)
    assert any(pattern.search(text) for text in TEXTS), "nothing prints this any more: %s" % message


@pytest.mark.parametrize("text", [*DRIVER_TEXTS, *TOOL_TEXTS])
def test_every_message_of_the_driver_and_the_tools_is_in_the_page(text):
    plain = PLACEHOLDER.sub("…", text).strip()
    assert any(make_pattern(message).match(plain) for message in MESSAGES), (
        "name it in docs/troubleshooting.md, with what to do: %s" % text
    )
