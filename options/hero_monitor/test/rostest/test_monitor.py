#!/usr/bin/env python3
"""The fleet monitor beside three simulated robots, looked at and clicked in a real browser."""

import math
import unittest

import rosgraph
import rospy
import rostest
from geometry_msgs.msg import Twist
from monitor_process import HOST, OTHER_HOST, TIMEOUT_S, PageClient, end, start_monitor, wait_until_it_answers
from rosgraph_msgs.msg import Log

from hero_sim.srv import InjectFault
from hero_test.nonempty import nonempty
from hero_test.processes import find_pid, suspended
from hero_test.screens.browser import MISSING
from hero_test.screens.monitor_page import MonitorPage
from hero_test.waiting import wait_for
from hero_test.watches.swarm_watch import SwarmWatch

HOSTILE = "<img src=x onerror='document.title=\"broken\"'><script>document.title='broken'</script> \u202e\x1b[31m"

COUNT_DRIVES = (
    "const send = WebSocket.prototype.send; window.sent = 0; WebSocket.prototype.send = function (text) {"
    "window.sent += text.includes('\"drive\"'); send.call(this, text) }"
)


@unittest.skipIf(MISSING, "not installed: %s (script/bootstrap --test)" % ", ".join(MISSING))
class PageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        wait_until_it_answers(HOST)
        cls.watch = SwarmWatch(range(3))
        cls.watch.wait_until_complete(TIMEOUT_S)
        cls.command = None
        cls.commands = []
        rospy.Subscriber("/hero_0/velocity_controller/cmd_vel", Twist, cls.receive_command)
        # A page that never reads must not hold up the other one.
        cls.stuck = PageClient(HOST)
        cls.page = MonitorPage("http://%s/" % HOST)

    @classmethod
    def tearDownClass(cls):
        cls.page.close()
        cls.stuck.close()
        cls.watch.close()

    @classmethod
    def receive_command(cls, message):
        """Keep the newest command of the monitor to robot 0: nothing else drives it."""
        cls.command = message
        cls.commands.append(message)

    def setUp(self):
        self.page.open()
        self.page.wait_for_text("#ready", "3 of 3 robots ready")

    def speed_of(self, robot_id):
        """Return the true speed over the last 0.2 s, m/s."""
        path = self.watch.path(robot_id)[-5:]
        return math.hypot(*(path[-1, 1:3] - path[0, 1:3])) / (path[-1, 0] - path[0, 0])

    def wait_until_moving(self, robot_id):
        wait_for(lambda: self.speed_of(robot_id) > 0.02, "robot %d to move" % robot_id)

    def wait_until_standing(self, robot_id):
        wait_for(lambda: self.speed_of(robot_id) < 0.005, "robot %d to stand" % robot_id)

    def drive(self, direction):
        """Hold a button until robot 0 moves."""
        self.page.hold(direction, lambda: self.command not in (None, Twist()) and self.speed_of(0) > 0.02, "motion")

    def wait_until_stopped(self):
        """Wait for a stop of robot 0: it would stand, too, 2 s after the last command."""
        wait_for(lambda: self.command == Twist(), "a stop")
        self.wait_until_standing(0)

    def test_the_table_shows_every_robot_with_address_rates_and_versions(self):
        for row in self.page.rows():
            if not row["Versions"].startswith("v3.8"):
                # It booted, and told its versions, before the driver listened.
                rospy.ServiceProxy("/hero_sim/fault", InjectFault)("reboot:robot=" + row["Robot"][len("hero_") :])
        wait_for(lambda: all(row["Versions"].startswith("v3.8") for row in nonempty(self.page.rows())), self.page.rows)
        self.page.wait_for_text("#ready", "3 of 3 robots ready")
        rows = self.page.rows()
        self.assertEqual([row["Robot"] for row in rows], ["hero_0", "hero_1", "hero_2"])
        for row in rows:
            self.assertIn("127.0.1.", row["Address"])
        wait_for(lambda: all(float(row["Odom"].split()[0]) > 0 for row in nonempty(self.page.rows())), "rates")
        self.page.save("monitor_desktop.png")
        self.page.resize(820, 1180)
        self.page.save("monitor_tablet.png")
        self.page.resize(1440, 900)

    def test_texts_from_outside_never_become_markup(self):
        self.page.errors()  # those of a monitor that has ended
        publisher = rospy.Publisher("/rosout", Log, queue_size=5)
        wait_for(publisher.get_num_connections, "listeners to the log")

        def is_shown():
            publisher.publish(Log(level=Log.WARN, name="/" + HOSTILE, msg="hero_0 " + HOSTILE))
            return "<script>" in self.page.text("#lines")

        wait_for(is_shown, "the line")
        self.assertEqual(self.page.run("return document.querySelectorAll('#lines img, #lines script').length"), 0)
        self.assertEqual(self.page.run("return document.title"), "HeRo fleet")
        self.assertNotIn("\u202e", self.page.text("#lines"))
        self.assertEqual(self.page.errors(), [])

    def test_a_stop_of_all_robots_ends_the_program_of_a_page(self):
        self.page.choose("hero_0")
        self.page.wait_for_text("#program", "random walk")
        self.page.find("#program [value='random_walk']").click()

        def is_started():
            if not self.page.text("#running"):  # a busy PC has delayed the request, or hides the button for a moment
                self.page.run("document.getElementById('start').click()")
            return self.page.text("#running").startswith("random walk, hero_0")

        wait_for(is_started, self.page.notices)
        self.wait_until_moving(0)
        self.page.press_stop()
        wait_for(lambda: self.page.text("#running") == "", "the end of the program")
        self.page.hold_release()
        publishers = [name for _, names in rosgraph.Master("/test").getSystemState()[0] for name in names]
        self.assertEqual([name for name in publishers if "random_walk" in name], [])
        wait_for(lambda: self.command == Twist(), "a stop")
        self.wait_until_standing(0)

    def test_a_robot_drives_while_a_button_is_held_and_stops_on_release(self):
        self.page.choose("hero_0")
        self.drive("forward")
        self.page.actions().release().perform()
        self.wait_until_stopped()

    def test_a_robot_stops_when_its_page_is_gone(self):
        self.page.choose("hero_0")
        self.drive("backward")
        # Leaves without a word: no release, no close.
        self.page.run("WebSocket.prototype.send = () => {}")
        self.wait_until_stopped()
        self.page.actions().release().perform()

    def test_a_monitor_that_was_suspended_drives_no_robot_by_old_commands(self):
        self.page.choose("hero_0")
        self.drive("forward")
        with suspended(find_pid("/hero_monitor")):
            self.page.run(COUNT_DRIVES)
            self.page.hold("forward", lambda: self.page.run("return window.sent") > 2, "commands in the socket")
            # The page falls silent, too: nothing but the monitor ends what its socket held.
            self.page.run("WebSocket.prototype.send = () => {}")
            self.wait_until_standing(0)
            self.commands.clear()
            start = self.watch.pose(0)[:2]
        wait_for(lambda: Twist() in self.commands, "a stop")
        self.wait_until_standing(0)
        # One command may have been on its way when the monitor was suspended.
        self.assertLess(math.dist(self.watch.pose(0)[:2], start), 0.02)
        self.page.actions().release().perform()

    def test_a_robot_stops_when_the_monitor_ends(self):
        process = start_monitor("_control:=true")
        try:
            wait_until_it_answers(OTHER_HOST)
            self.page.browser.get("http://%s/" % OTHER_HOST)
            self.page.wait_for_text("#ready", "3 of 3")
            self.page.choose("hero_0")
            self.page.hold("turn left", lambda: self.command not in (None, Twist()), "a command")
        finally:
            output = end(process)
        self.wait_until_stopped()
        self.assertNotIn("Traceback", output)
        self.page.actions().release().perform()

    def click_on_map(self, right_px, down_px):
        self.page.click("#goto")
        canvas = self.page.find("#canvas")
        self.page.actions().move_to_element(canvas).move_by_offset(right_px, down_px).click().perform()
        self.page.click("#goto")

    @staticmethod
    def has_goal_program():
        """Return whether a node takes goals for hero_1; the monitor shows them."""
        subscribers = dict(rosgraph.Master("/test").getSystemState()[1]).get("/hero_1/goal", [])
        return set(subscribers) - {"/hero_monitor"}

    def test_a_click_on_the_map_sends_a_robot_there_where_a_program_listens(self):
        self.page.choose("hero_1")
        start = self.watch.pose(1)[:2]
        wait_for(self.has_goal_program, "go_to_goal")
        self.click_on_map(0, 0)
        self.page.wait_for_notice("hero_1 has a new goal")
        wait_for(lambda: math.dist(self.watch.pose(1)[:2], start) > 0.05, "robot 1 to go")

    def test_a_goal_that_no_program_takes_is_reported(self):
        self.page.choose("hero_0")
        self.click_on_map(30, 30)
        self.page.wait_for_notice("go_to_goal.launch")

    def test_stop_all_stops_driven_robots_and_a_hold_releases_them(self):
        publisher = rospy.Publisher("/hero_2/velocity_controller/cmd_vel", Twist, queue_size=1)
        command = Twist()
        command.linear.x = 0.03
        command.angular.z = 1.0  # on a small circle: there is nothing to run into
        timer = rospy.Timer(rospy.Duration(0.1), lambda event: publisher.publish(command))
        try:
            self.wait_until_moving(2)
            self.page.click("#stop")
            self.wait_until_standing(2)
            self.page.wait_for_text("#stopping", "stopped, all wheels at rest")
            self.page.save("monitor_stopped.png")
            self.page.hold_release()
            self.wait_until_moving(2)
        finally:
            timer.shutdown()
        self.page.wait_for_text("#stop", "STOP ALL")


if __name__ == "__main__":
    rospy.init_node("test_monitor")
    rostest.rosrun("hero_monitor", "test_monitor", PageTest)
