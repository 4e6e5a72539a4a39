#!/usr/bin/env python3
"""STOP ALL, Release and driving by touch and keyboard in a real browser, at every size of screen; without ROS.

The page's clock and its periodic timers are the test's: what a page does after a second depends on no load.
"""

import unittest

import rostest
from scripted_monitor import LONG_CAUSE, ScriptedMonitor, make_fleet, make_robot

from hero_test.screens.browser import MISSING
from hero_test.screens.monitor_page import MonitorPage
from hero_test.waiting import wait_for

PORTRAIT = [(320, 568), (360, 740), (390, 844), (820, 1180)]
SIZES = [*PORTRAIT, *((height, width) for width, height in PORTRAIT), (1440, 900), (1920, 1080)]
ROBOTS = [make_robot(number) for number in range(3)]
UNKNOWN = [make_robot(number, known=False) for number in range(3)]
LOSSES = [{"source": "driver", "cause": LONG_CAUSE, "remedy": "switch off robots that move"}] * 3


def make_status(level, text):
    return {"level": level, "text": text, "is_final": level == "info", "reads": 0}


LONG_STATUS = make_status("error", "NOT STOPPED: " + ", ".join("hero_%d" % number for number in range(60)) + " move")
REST = make_status("info", "stopped, all wheels at rest")

STATES = {
    "empty": {"fleet": make_fleet(), "losses": [], "stop": None},
    "live": {"fleet": make_fleet(*ROBOTS)},
    "stopping": {"stop": make_status("warn", "stopping")},
    "stopped": {"fleet": make_fleet(*ROBOTS, stopped=True), "stop": REST},
    "not stopped": {"stop": LONG_STATUS},
    "unknown": {"fleet": make_fleet(*UNKNOWN, stopped=True), "losses": LOSSES},
}

TAKE_CLOCK = """
const timers = new Map();
let now = 0, date = Date.now(), last = 0;
performance.now = () => now;
Date.now = () => date;
window.setInterval = (act, periodMs) => (timers.set(++last, { act, periodMs, dueMs: now + periodMs }), last);
window.clearInterval = (id) => timers.delete(id);
// The page is suspended for a while.
window.suspend = (ms) => {
  now += ms;
  date += ms;
  for (const timer of timers.values()) {
    if (timer.dueMs > now) continue;
    timer.dueMs = now + timer.periodMs;
    timer.act();
  }
};
// A while passes on a page that runs.
window.advance = (ms) => { for (const end = now + ms; now < end;) window.suspend(Math.min(50, end - now)); };
"""

FIND_BUTTONS = """
const place = (id) => {
  const { left, top, width, height } = document.getElementById(id).getBoundingClientRect();
  return [left, top, width, height];
};
const [left, top, width, height] = place("stop");
const at = (x, y) => document.elementFromPoint(left + x * width, top + y * height);
const points = [[0.5, 0.5], [0.08, 0.2], [0.92, 0.2], [0.08, 0.8], [0.92, 0.8]];
const covered = points.filter(([x, y]) => at(x, y).id !== "stop");
return { stop: place("stop"), release: place("release"), covered, size: [innerWidth, innerHeight] };
"""


@unittest.skipIf(MISSING, "not installed: %s (script/bootstrap --test)" % ", ".join(MISSING))
class TouchTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.is_touched = False
        cls.monitor = ScriptedMonitor()
        cls.page = MonitorPage(cls.monitor.url)
        cls.page.browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": TAKE_CLOCK})
        cls.page.browser.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": True, "maxTouchPoints": 2})

    @classmethod
    def tearDownClass(cls):
        cls.page.close()
        cls.monitor.close()

    def setUp(self):
        self.monitor.is_silent = False
        self.show("empty")
        self.show("live")
        self.page.open()
        self.page.wait_for_text("#ready", "3 of 3 robots ready")
        self.monitor.requests.clear()

    def tearDown(self):
        if self.is_touched:
            self.touch("touchCancel")

    def show(self, name):
        self.monitor.show(**STATES[name])
        return name

    def let_arrive(self, mark):
        """Wait until the page has all that the monitor sent so far."""
        self.monitor.tell(notice={"level": "info", "text": mark})
        self.page.wait_for_notice(mark)

    def silence_monitor(self):
        self.monitor.is_silent = True
        self.let_arrive("the last words")

    def advance(self, ms):
        """Let the page's time pass."""
        self.page.run("window.advance(%d)" % ms)

    def suspend(self, ms):
        """Let time pass in which the page does not run."""
        self.page.run("window.suspend(%d)" % ms)

    def touch(self, kind, *place):
        TouchTest.is_touched = kind == "touchStart"
        points = [{"x": place[0], "y": place[1]}] if place else []
        self.page.browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def tap(self, place):
        self.touch("touchStart", *place)
        self.touch("touchEnd")

    def find(self, name):
        """Return the middle of a button."""
        left, top, width, height = self.page.run(FIND_BUTTONS)[name]
        return left + width / 2, top + height / 2

    def press_key(self, kind, key):
        text = {"Enter": "\r", "Space": " "}[key]
        self.page.send_key(kind, key, key=key if key == "Enter" else " ", text=text)

    def stop(self):
        self.tap(self.find("stop"))
        self.page.wait_for_text("#stop", "STOPPED")

    def pass_time(self, ms):
        """Let the page's time pass; at its end the page hears the monitor again."""
        self.advance(ms)
        self.page.wait_for_text("#link", "live")

    def is_held(self):
        return self.page.run("return !!document.querySelector('#release.holding')")

    def hold_release(self):
        self.touch("touchStart", *self.find("release"))
        wait_for(self.is_held, "the hold")

    def check_that_nothing_was_released(self):
        """Stop once more, which the monitor hears of after all that was sent before."""
        stops = len(self.monitor.requested("stop"))
        self.tap(self.find("stop"))
        wait_for(lambda: len(self.monitor.requested("stop")) > stops, "another stop")
        self.assertEqual(self.monitor.requested("release"), [])

    def test_stop_all_keeps_its_place_at_every_size_in_every_state(self):
        places = {size: set() for size in SIZES}
        for state in [*STATES, "silent"]:
            if state == "silent":
                self.silence_monitor()
                self.advance(2000)
                self.page.wait_for_text("#losses", "No answer from the monitor")
            else:
                self.show(state)
                self.let_arrive(state + " is shown")
                self.advance(200)
            for size in SIZES:
                self.page.resize(*size)
                found = self.page.run(FIND_BUTTONS)
                self.assertEqual((found["covered"], tuple(found["size"])), ([], size), (state, size))
                places[size].add(tuple(found["stop"]))
                left, top, width, height = found["release"]
                if width:
                    self.assertGreater(top, 0.6 * size[1], (state, size))
                    self.assertLess(left, 20, (state, size))
                    self.assertLessEqual(top + height, size[1], (state, size))
        self.page.resize(1440, 900)
        self.assertEqual({size: len(found) for size, found in places.items()}, dict.fromkeys(SIZES, 1))

    def test_a_notice_does_not_cover_the_release_that_it_asks_for(self):
        self.stop()
        self.let_arrive("all robots are stopped: release them first")
        for size in SIZES:
            self.page.resize(*size)
            _, top, _, height = self.page.run(FIND_BUTTONS)["release"]
            notice = self.page.find("#notices p").rect
            self.assertLess(notice["y"] + notice["height"], top, size)
            self.assertGreater(height, 0, size)

    def test_three_quick_taps_on_stop_all_or_release_never_release(self):
        for size in (SIZES[0], SIZES[4], SIZES[-1]):  # the buttons keep their places at all sizes
            self.page.resize(*size)
            for state, ready in ("empty", "0 of 0 robots ready"), ("live", "3 of 3 robots ready"):
                self.show(state)
                self.page.wait_for_text("#ready", ready)
            self.page.wait_for_text("#stop", "STOP ALL")
            self.monitor.requests.clear()
            for _ in range(3):
                self.tap(self.find("stop"))
            self.page.wait_for_text("#stop", "STOPPED")
            self.pass_time(2000)
            for _ in range(3):
                self.tap(self.find("release"))
            self.check_that_nothing_was_released()

    def test_release_acts_when_a_finger_holds_it_for_a_second(self):
        self.page.resize(360, 740)
        self.stop()
        self.pass_time(2000)
        self.hold_release()
        self.advance(950)
        self.assertTrue(self.is_held())
        self.advance(50)
        self.monitor.wait_for_request("release")
        self.touch("touchEnd")
        self.page.wait_for_text("#stop", "STOP ALL")

    def test_release_does_nothing_for_two_seconds_after_a_stop(self):
        self.stop()
        self.pass_time(1900)
        self.touch("touchStart", *self.find("release"))
        self.page.wait_for_notice("Hold Release for 1 s")
        self.pass_time(1500)
        self.touch("touchEnd")
        self.check_that_nothing_was_released()

    def test_a_stop_of_another_page_ends_a_hold_of_release(self):
        self.stop()
        self.pass_time(2000)
        self.hold_release()
        self.show("stopping")
        self.page.wait_for_text("#stopping", "stopping")
        self.advance(1000)
        self.assertFalse(self.is_held())
        self.touch("touchEnd")
        self.check_that_nothing_was_released()

    def test_a_hold_of_release_ends_when_the_page_is_suspended(self):
        self.stop()
        self.pass_time(2000)
        self.hold_release()
        self.suspend(1500)
        self.assertFalse(self.is_held())
        self.touch("touchEnd")
        self.check_that_nothing_was_released()

    def test_the_keyboard_stops_at_a_press_and_releases_at_a_hold(self):
        self.page.run("document.getElementById('stop').focus()")
        for kind in ("keyDown", "keyUp"):
            self.press_key(kind, "Enter")
        self.page.wait_for_text("#stop", "STOPPED")
        self.pass_time(2000)
        self.page.run("document.getElementById('release').focus()")
        for key in ("Enter", "Space", "Enter"):
            for kind in ("keyDown", "keyUp"):
                self.press_key(kind, key)
        self.assertEqual(self.monitor.requested("release"), [])
        self.press_key("keyDown", "Space")
        wait_for(self.is_held, "the hold")
        self.advance(1000)
        self.monitor.wait_for_request("release")
        self.press_key("keyUp", "Space")

    def test_a_page_that_hears_nothing_shows_all_as_unknown_within_two_seconds(self):
        self.assertEqual({row["State"] for row in self.page.rows()}, {"READY"})
        self.silence_monitor()
        self.advance(2000)
        self.page.wait_for_text("#losses", "No answer from the monitor since")
        self.assertEqual({row["State"] for row in self.page.rows()}, {"UNKNOWN"})
        self.assertIn("roslaunch hero_bringup monitor.launch", self.page.text("#losses"))
        self.assertEqual((self.page.text("#link"), self.page.text("#ready")), ("unknown", "robots unknown"))
        self.assertEqual(self.page.run("return document.querySelectorAll('.good').length"), 0)
        self.monitor.is_silent = False
        self.page.wait_for_text("#ready", "3 of 3 robots ready")

    def test_who_presses_stop_all_again_and_again_reads_that_nothing_answers(self):
        self.silence_monitor()
        for _ in range(4):
            self.tap(self.find("stop"))
            self.advance(500)
        self.assertEqual(self.page.banner(), ("error", "NOT STOPPED: the monitor does not answer"))
        self.assertEqual(len(self.monitor.requested("stop")), 4)

    def test_a_page_that_was_suspended_stops_driving_and_knows_nothing(self):
        self.page.choose("hero_0")
        button = self.page.find("#pad [aria-label='forward']").rect
        self.touch("touchStart", button["x"] + 9, button["y"] + 9)
        self.monitor.wait_for_request("drive")
        self.silence_monitor()
        self.suspend(3000)
        self.monitor.wait_for_request("end_drive")
        self.page.wait_for_text("#ready", "robots unknown")
        self.assertEqual(self.monitor.requests[-1]["do"], "end_drive")
        self.touch("touchEnd")


if __name__ == "__main__":
    rostest.rosrun("hero_monitor", "test_monitor_touch", TouchTest)
