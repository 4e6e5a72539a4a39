"""LogRelay: which lines reach rospy's logger."""

import logging
from unittest import mock

import pytest

from hero_driver.ros import log_relay
from hero_driver.ros.log_relay import ROBOT_LINES_MAX, LogRelay


class Lines(logging.Handler):
    """Keeps what is logged."""

    def __init__(self):
        super().__init__()
        self.texts = []

    def emit(self, record):
        """Take a line."""
        self.texts.append((record.levelname, record.getMessage()))


@pytest.fixture(name="rosout")
def make_rosout():
    """Give rospy's logger with a handler that keeps lines; what it was before comes back."""
    logger = logging.getLogger("rosout")
    level, lines = logger.level, Lines()
    logger.addHandler(lines)
    yield logger, lines.texts
    logger.removeHandler(lines)
    logger.setLevel(level)


@pytest.mark.parametrize(
    ("level", "first"),
    [(logging.DEBUG, 0), (logging.INFO, 1), (logging.WARNING, 2), (logging.ERROR, 3), (logging.CRITICAL, 4)],
)
def test_logs_what_the_level_lets_through(rosout, level, first):
    logger, texts = rosout
    relay = LogRelay()
    logger.setLevel(level)
    for name in ("debug", "info", "warn", "error", "fatal"):
        relay.log(name, "a %s line, 100 %%" % name)
    relay.close()
    expected = [
        ("DEBUG", "a debug line, 100 %"),
        ("INFO", "a info line, 100 %"),
        ("WARNING", "a warn line, 100 %"),
        ("ERROR", "a error line, 100 %"),
        ("CRITICAL", "a fatal line, 100 %"),
    ]
    assert texts == expected[first:]


def test_a_level_that_is_set_later_counts(rosout):
    logger, texts = rosout
    relay = LogRelay()
    logger.setLevel(logging.INFO)
    relay.log("debug", "before")
    logger.setLevel(logging.DEBUG)
    relay.log("debug", "after")
    relay.close()
    assert texts == [("DEBUG", "after")]


def test_one_warning_again_and_again_keeps_no_other_out(rosout, monkeypatch):
    _, texts = rosout
    relay = LogRelay()
    now_s = 1000.0
    monkeypatch.setattr(log_relay.time, "monotonic", lambda: now_s)
    for _ in range(10 * ROBOT_LINES_MAX):
        relay.log_throttled("error", "same", "the same warning", robot="hero_1")
    relay.log_throttled("error", "other", "another warning", robot="hero_1")
    now_s += log_relay.THROTTLE_S
    relay.log_throttled("error", "same", "the same warning", robot="hero_1")
    relay.close()
    more = "the same warning (and %d times more before)" % (10 * ROBOT_LINES_MAX - 1)
    assert [text for _, text in texts] == ["the same warning", "another warning", more]


def test_different_messages_about_one_robot_are_limited(rosout):
    _, texts = rosout
    relay = LogRelay()
    for number in range(10 * ROBOT_LINES_MAX):
        relay.log_throttled("error", "warning %d" % number, "warning %d" % number, robot="hero_1")
    relay.log_throttled("error", "other", "about another robot", robot="hero_2")
    relay.close()
    assert len(texts) == ROBOT_LINES_MAX + 2
    assert texts[ROBOT_LINES_MAX] == ("WARNING", "hero_1: too many different messages; further ones are suppressed")
    assert texts[-1] == ("ERROR", "about another robot")


def test_lines_that_were_dropped_are_counted_once(rosout):
    logger, texts = rosout
    logger.setLevel(logging.INFO)
    relay = LogRelay()
    relay._worker.refused = 3
    for number in range(2):
        relay.log("warn", "line %d" % number)
    relay._worker.refused = 5
    with mock.patch.object(relay._worker, "submit", autospec=True, return_value=False):
        relay.log("warn", "dropped, and told of in the next one")
    relay.log("warn", "line 2")
    relay.close()
    said = ["line 0 (3 log lines before it were dropped)", "line 1", "line 2 (2 log lines before it were dropped)"]
    assert [text for _, text in texts] == said
