#!/usr/bin/env python3
"""STOP ALL in a real browser: what people see while robots stop, stand, move though stopped, or nobody answers."""

import contextlib
import json
import unittest

import rosgraph
import rospy
import rostest
from geometry_msgs.msg import Twist
from monitor_process import (
    HOST,
    OTHER_HOST,
    OTHER_PORT,
    end,
    start_master,
    start_monitor,
    start_scripted_driver,
    wait_until_it_answers,
)
from std_msgs.msg import Bool, String

from hero_msgs.msg import RobotArray
from hero_test.nonempty import nonempty
from hero_test.processes import find_pid, suspended
from hero_test.screens.browser import MISSING
from hero_test.screens.monitor_page import MonitorPage
from hero_test.waiting import wait_for

DRIVERS = ("hero_driver", "hero_driver_b")
RED, AMBER, GREEN = "error", "warn", "info"
# Until the chart, which is drawn more seldom than the banner, has told its value three times.
FIND_VAIN_CHANGES = """
const done = arguments[0], found = new Set();
let told = 0;
const observer = new MutationObserver((changes) => changes.forEach(({ target, attributeName: name, oldValue }) => {
  if (name && target.getAttribute(name) === oldValue) found.add(`${target.id} ${name}`);
  told += target.id === "chart_now";
  if (told < 3) return;
  observer.disconnect();
  done([...found]);
}));
for (const id of ["stopping", "release_bar", "stop", "release", "chart_now"])
  observer.observe(document.getElementById(id), { childList: true, attributes: true, attributeOldValue: true });"""


@unittest.skipIf(MISSING, "not installed: %s (script/bootstrap --test)" % ", ".join(MISSING))
class StopTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        wait_until_it_answers(HOST)
        cls.drivers = [
            start_scripted_driver("hero_driver", [0, 1, 2, 3], twin_of=0),
            start_scripted_driver("hero_driver_b", [100, 101]),
        ]
        cls.reports = {}
        for name in DRIVERS:
            rospy.Subscriber("/%s/robots" % name, RobotArray, cls.receive, name)
        cls.behave = rospy.Publisher("/hero_driver/behave", String, queue_size=5)
        cls.requests = [rospy.Publisher("/%s/stop_request" % name, Bool, queue_size=5) for name in DRIVERS]
        cls.page, cls.other = (MonitorPage("http://%s/" % HOST) for _ in range(2))

    @classmethod
    def tearDownClass(cls):
        cls.page.close()
        cls.other.close()
        for driver in cls.drivers:
            end(driver)

    @classmethod
    def receive(cls, message, name):
        cls.reports[name] = message

    def setUp(self):
        for publisher in (self.behave, *self.requests):
            wait_for(publisher.get_num_connections, "connections to the drivers")
        self.set_behavior()
        self.pages = []
        self.open_page(self.page)
        self.release()

    def open_page(self, page):
        page.open()
        page.wait_for_text("#ready", "6 of 6")
        self.pages.append(page)

    def open_other(self):
        self.open_page(self.other)
        self.addCleanup(self.other.leave)

    def tearDown(self):
        self.set_behavior()
        self.release()

    def set_behavior(self, moving=(), rest=True):
        self.behave.publish(json.dumps({"moving": moving, "rest": rest}))

    def release(self):
        def ask():
            # Again and again: a monitor that has not heard of its own stop yet goes on asking for it.
            for publisher in self.requests:
                publisher.publish(False)
            return self.all_report(False)

        wait_for(ask, "the release")

    def wait_for_reports(self, stopped):
        wait_for(lambda: self.all_report(stopped), "stopped: %s" % stopped)

    def all_report(self, stopped):
        return [report.stopped for report in self.reports.values()] == [stopped] * len(DRIVERS)

    def wait_for_banner(self, level, text):
        for page in self.pages:
            page.wait_for_text("#stopping", text)
            is_shown = lambda page=page: page.banner()[0] == level and page.banner()[1].startswith(text)  # noqa: E731
            wait_for(is_shown, lambda page=page: page.banner())

    def stop_states(self, page):
        return {row["Robot"]: row["Stop"] for row in page.rows() if row["State"] != "REFUSED"}

    def test_what_a_page_shows_of_stopping_is_not_painted_without_a_change(self):
        self.assertEqual(self.page.browser.execute_async_script(FIND_VAIN_CHANGES), [])

    def test_all_pages_show_that_robots_are_stopping_and_at_rest(self):
        self.open_other()
        self.set_behavior(rest=False)
        self.assertEqual(self.page.press_stop(), (AMBER, "stopping"))
        wait_for(lambda: self.stop_states(self.page)["hero_0"] == "stopping", "a robot that stops")
        self.page.save("monitor_stopping.png")
        self.set_behavior()
        self.wait_for_banner(GREEN, "stopped, all wheels at rest")
        self.page.save("monitor_at_rest.png")
        for page in self.pages:
            # Banner and table are told one after the other.
            wait_for(lambda page=page: set(self.stop_states(page).values()) == {"at rest"}, page.rows)
            page.wait_for_text("#stop", "STOPPED")

    def test_a_robot_that_moves_though_stopped_is_named_in_red_until_it_stands(self):
        self.open_other()
        self.set_behavior(moving=[3])
        self.page.click("#stop")
        self.wait_for_banner(RED, "NOT STOPPED: hero_3 moves")
        self.page.save("monitor_not_stopped.png")
        for page in self.pages:
            wait_for(lambda page=page: self.stop_states(page)["hero_3"] == "MOVING", page.rows)
            page.wait_for_text("#stop", "STOP ALL")
        self.set_behavior()
        self.wait_for_banner(GREEN, "stopped, all wheels at rest")

    def test_a_robot_that_moves_after_the_stop_of_another_program_is_named(self):
        for publisher in self.requests:
            publisher.publish(True)
        self.wait_for_reports(True)
        self.page.wait_for_text("#stopping", "stopped")
        self.set_behavior(moving=[2])
        wait_for(lambda: self.page.banner() == (RED, "NOT STOPPED: hero_2 moves"), self.page.banner)

    def test_a_page_drives_no_robot_until_all_are_released(self):
        self.open_other()
        commands = []
        rospy.Subscriber("/hero_2/velocity_controller/cmd_vel", Twist, commands.append)
        self.page.choose("hero_2")
        self.page.hold("forward", lambda: any(command.linear.x > 0 for command in commands), "a command")
        # Pressed on another page, while the button is held.
        self.other.click("#stop")
        wait_for(lambda: commands[-1].linear.x == 0, "a stop")
        self.wait_for_banner(GREEN, "stopped, all wheels at rest")
        self.page.actions().release().perform()
        refusal = "all robots are stopped: release them first"
        self.page.hold("forward", lambda: refusal in self.page.notices(), "a notice")
        self.assertEqual(commands[-1].linear.x, 0.0)
        self.page.actions().release().perform()

    def test_after_a_release_an_arrow_key_that_is_still_held_moves_no_robot(self):
        self.open_other()
        commands = []
        rospy.Subscriber("/hero_2/velocity_controller/cmd_vel", Twist, commands.append)
        self.page.choose("hero_2")
        self.page.run("document.getElementById('pad').focus()")
        for stopping in nonempty(self.pages):
            self.page.send_key("keyDown", "ArrowUp")
            wait_for(lambda: commands and commands[-1].linear.x > 0, "a command")
            stopping.press_stop()
            self.wait_for_banner(GREEN, "stopped, all wheels at rest")
            self.assertEqual(commands[-1].linear.x, 0.0)
            del commands[:]
            self.release()
            self.page.wait_for_text("#stop", "STOP ALL")
            # Commands arrive in order: what the held key had sent would be before those of the new press.
            for _ in range(2):
                self.repeat_key("ArrowUp")
                wait_for(lambda: self.press_again("ArrowDown", commands), "a command of a new press")
                self.page.send_key("keyUp", "ArrowDown")
                wait_for(lambda: commands[-1].linear.x == 0, "the end of the new press")
            self.page.send_key("keyUp", "ArrowUp")
            self.assertFalse([command for command in commands if command.linear.x > 0])

    def test_a_press_counts_from_when_it_is_made_not_from_the_last_clock(self):
        script = (
            "const done = arguments[0], nothing = () => {};"
            "import('./connection.js').then(({ Connection }) => {"
            "  const connection = new Connection({ onOpen: nothing, onChange: nothing });"
            "  connection.clockMs = 5000;"
            "  connection.clockHeardMs = performance.now() - 110;"
            "  done(connection.nowMs);"
            "});"
        )
        self.open_page(self.page)
        self.assertGreaterEqual(self.page.browser.execute_async_script(script), 5110)

    def repeat_key(self, code):
        """Send what a keyboard sends while a key is held."""
        for _ in range(20):
            self.page.send_key("keyDown", code, autoRepeat=True)

    def press_again(self, code, commands):
        """Press a key unless it drives backward already; return whether it does."""
        if commands and commands[-1].linear.x < 0:
            return True
        self.page.send_key("keyUp", code)
        self.page.send_key("keyDown", code)
        return False

    def test_a_stop_of_one_robot_ends_the_hold_of_another_page(self):
        self.open_other()
        commands = []
        rospy.Subscriber("/hero_2/velocity_controller/cmd_vel", Twist, commands.append)
        for page in self.pages:
            page.choose("hero_2")

        def is_driven():
            return bool(commands) and commands[-1].linear.x > 0

        self.page.hold("forward", is_driven, "a command")
        self.other.click("#stop_some")
        self.page.wait_for_notice("hero_2 was stopped: let go, and press again to drive")
        self.other.wait_for_notice("stopped: hero_2; another page drove, and needs a new press to drive again")
        wait_for(lambda: commands[-1].linear.x == 0, "a stop")
        wait_for(lambda: not self.page.run("return !!document.querySelector('#pad .down')"), "the end of the hold")
        self.page.save("monitor_hold_over.png")
        self.assertEqual(commands[-1].linear.x, 0.0)
        self.page.hold("forward", is_driven, "a command of a new press")
        self.page.actions().release().perform()

    def test_a_driver_that_hangs_is_named_and_the_other_one_stops(self):
        with suspended(self.drivers[1].pid):
            self.page.click("#stop")
            wait_for(lambda: self.reports["hero_driver"].stopped, "the stop of the other driver")
            self.wait_for_banner(RED, "NOT STOPPED: driver hero_driver_b does not answer")
        self.wait_for_banner(GREEN, "stopped, all wheels at rest")

    def test_a_stop_needs_no_ros_master(self):
        with suspended(rosgraph.Master("/test").getPid()):
            self.page.click("#stop")
            self.wait_for_reports(True)
            self.wait_for_banner(GREEN, "stopped, all wheels at rest")
            self.page.wait_for_text("#losses", "No ROS master")
            self.page.wait_for_text("#link", "master lost")
        self.page.wait_for_text("#link", "live")

    def test_robots_of_a_driver_that_hangs_or_ended_are_unknown(self):
        wait_for(lambda: self.states("hero_100") == {"READY"}, self.page.rows)
        with suspended(self.drivers[1].pid):
            wait_for(lambda: self.states("hero_100", "hero_101") == {"UNKNOWN"}, self.page.rows)
            self.page.wait_for_text("#losses", "No answer from hero_driver_b: its robots are unknown")
            wait_for(lambda: self.states("hero_1") == {"READY"}, self.page.rows)
            self.page.save("monitor_unknown.png")
        wait_for(lambda: self.states("hero_100") == {"READY"}, self.page.rows)
        end(self.drivers[0])
        try:
            wait_for(lambda: self.states("hero_1", "hero_2") <= {"UNKNOWN"}, self.page.rows)
            self.page.wait_for_text("#losses", "No answer from hero_driver")
        finally:
            self.drivers[0] = start_scripted_driver("hero_driver", [0, 1, 2, 3], twin_of=0)
        self.page.wait_for_text("#ready", "6 of 6")

    def test_a_page_shows_robots_again_once_master_and_driver_are_back(self):
        port = OTHER_PORT + 1000
        prefix = ["env", "ROS_MASTER_URI=http://127.0.0.1:%d" % port]
        with contextlib.ExitStack() as stack:

            def start(start_one, *arguments, **options):
                process = start_one(*arguments, **options)
                stack.callback(end, process)
                return process

            master = start(start_master, port)
            driver = start(start_scripted_driver, "hero_driver", [0, 1], prefix=prefix)
            start(start_monitor, prefix=prefix)
            wait_until_it_answers(OTHER_HOST)
            self.page.browser.get("http://%s/" % OTHER_HOST)
            self.page.wait_for_text("#ready", "2 of 2 robots ready")
            end(master)
            end(driver)
            self.page.wait_for_text("#losses", "No answer from hero_driver")
            self.page.wait_for_text("#losses", "No ROS master")
            self.page.wait_for_text("#ready", "2 of 2 robots unknown")
            start(start_master, port)
            start(start_scripted_driver, "hero_driver", [0, 1, 2], prefix=prefix)
            self.page.wait_for_text("#ready", "3 of 3 robots ready")
            wait_for(lambda: self.page.text("#losses") == "", "no loss")

    def states(self, *robots):
        return {row["State"].partition(",")[0] for row in self.page.rows() if row["Robot"] in robots}

    def test_the_page_reports_that_the_monitor_does_not_answer(self):
        with suspended(find_pid("/hero_monitor")):
            self.assertEqual(self.page.press_stop(), (AMBER, "stopping"))
            self.wait_for_banner(RED, "NOT STOPPED: the monitor does not answer")
            self.page.save("monitor_no_answer.png")
        self.wait_for_reports(True)
        self.wait_for_banner(GREEN, "stopped, all wheels at rest")

    def test_a_stop_without_a_connection_is_sent_once_there_is_one(self):
        process = start_monitor()
        try:
            wait_until_it_answers(OTHER_HOST)
            self.page.browser.get("http://%s/" % OTHER_HOST)
            self.page.wait_for_text("#ready", "6 of 6")
        finally:
            end(process)
        self.page.wait_for_text("#losses", "No connection to the monitor")
        wait_for(lambda: {row["State"] for row in self.page.rows()} == {"UNKNOWN"}, self.page.rows)
        self.page.click("#stop")
        self.assertEqual(self.page.banner(), (RED, "NOT STOPPED: there is no connection to the monitor"))
        process = start_monitor()
        try:
            self.wait_for_reports(True)
            self.wait_for_banner(GREEN, "stopped, all wheels at rest")
        finally:
            end(process)


if __name__ == "__main__":
    rospy.init_node("test_monitor_stop")
    rostest.rosrun("hero_monitor", "test_monitor_stop", StopTest)
