#!/usr/bin/env python3
"""Which names, types, services and parameters a robot may use."""

import subprocess
import tempfile
from pathlib import Path

import rospy
import rostest
from std_msgs.msg import Bool, ColorRGBA
from tf2_msgs.msg import TFMessage

from hero_msgs.msg import Encoder, Robot
from hero_msgs.srv import SetOdom
from hero_test import stock_messages
from hero_test.driver_case import (
    OwnDriverCase,
    Recorder,
    list_driver_topics,
    list_publishers,
    make_publisher,
    wait_payloads,
)
from hero_test.fake_robot import (
    PUB,
    REQUESTS,
    STOCK_DECLARATIONS,
    SUB,
    Declaration,
    encode_answer,
)
from hero_test.stock_messages import STRING_MD5, WRONG_MD5, make_text
from hero_test.waiting import wait_for


class TestDriverPolicy(OwnDriverCase):
    """Parameters as they are by default."""

    def test_names_outside_the_robots_own_are_refused_and_its_others_work(self):
        foreign = [
            Declaration(PUB, 140, "/chatter", "std_msgs/String", STRING_MD5),
            Declaration(PUB, 141, "/hero_2/odom", "nav_msgs/Odometry", STOCK_DECLARATIONS[5].md5sum),
            Declaration(SUB, 120, "/hero_10/led", "std_msgs/ColorRGBA", STOCK_DECLARATIONS[12].md5sum),
            Declaration(PUB, 142, "/rosout", "std_msgs/String", STRING_MD5),
            Declaration(PUB, 143, "chatter", "std_msgs/String", STRING_MD5),
            Declaration(PUB, 144, "/hero_1", "std_msgs/String", STRING_MD5),
        ]
        driver = self.share()
        robot = self.dial(driver, 1, declarations=[*STOCK_DECLARATIONS, *foreign])
        for entry in foreign:
            driver.wait_line(r"hero_1: topic '%s' refused: outside /hero_1" % entry.name)
            self.assertEqual(len(driver.find_lines("topic '%s' refused" % entry.name)), 1)
        encoders = Recorder("/hero_1/encoder", Encoder)
        robot.send_packet(140, make_text("not heard"))
        robot.send("encoder", stock_messages.make_encoder("hero_1", rospy.Time.now(), 1.0, 1.0))
        encoders.wait_count(1)
        self.assertEqual(list_publishers("/chatter"), [])
        self.assertEqual(list_driver_topics("/hero_2", driver.node), [])
        self.assertEqual(list_driver_topics("/hero_10", driver.node), [])
        self.assertNotEqual(driver.fleet.find("/hero_1").last_error, "")

    def test_a_robot_that_says_where_it_is_in_the_map_is_not_heard(self):
        pose_type = "geometry_msgs/PoseWithCovarianceStamped"
        own_pose = Declaration(PUB, 140, "/{}/measured_pose", pose_type, "953b798c0f514ff060a53a3498ce6246")
        driver = self.share()
        self.dial(driver, 5, declarations=[*STOCK_DECLARATIONS, own_pose])
        driver.wait_line("hero_5: topic '/hero_5/measured_pose' refused: robots do not send it")
        self.assertEqual(list_publishers("/hero_5/measured_pose"), [])

    def test_a_wrong_md5_and_an_unknown_type_give_one_clear_error_each(self):
        changed = [
            entry._replace(md5sum=WRONG_MD5)
            if entry.name in ("/{}/encoder", "/{}/led") or (entry.kind == REQUESTS and "set_odom" in entry.name)
            else entry
            for entry in STOCK_DECLARATIONS
        ]
        changed.append(Declaration(PUB, 140, "/{}/battery", "hero_common/Battery", WRONG_MD5))
        changed.append(Declaration(PUB, 141, "/{}/alien", "alien_msgs/Saucer", WRONG_MD5))
        driver = self.share()
        robot = self.dial(driver, 4, declarations=changed)
        line = driver.wait_line("hero_4: topic /hero_4/encoder refused")
        for part in (WRONG_MD5, Encoder._md5sum, "flash firmware", "odom is the robot's own estimate"):
            self.assertIn(part, line)
        driver.wait_line("hero_4: topic /hero_4/led refused: .*%s.*std_msgs" % WRONG_MD5)
        driver.wait_line("hero_4: service /hero_4/set_odom refused: .*%s" % WRONG_MD5)
        driver.wait_line("hero_4: topic /hero_4/battery refused: type hero_msgs/Battery .*hero_msgs")
        driver.wait_line("hero_4: topic /hero_4/alien refused: type alien_msgs/Saucer .*alien_msgs")
        raw, odom = (Recorder("/hero_4/" + name, rospy.AnyMsg) for name in ("odom_raw", "odom"))
        robot.declare()  # again, and no second warning
        robot.send("encoder", stock_messages.make_encoder("hero_4", rospy.Time.now(), 1.0, 1.0))
        robot.send("odom", stock_messages.make_odom("hero_4", rospy.Time.now()))
        raw.wait_count(1)
        odom.wait_count(1)
        self.assertEqual(list_publishers("/hero_4/encoder"), [])
        for name in (
            "topic /hero_4/encoder",
            "topic /hero_4/led",
            "service /hero_4/set_odom",
            "topic /hero_4/alien",
        ):
            self.assertEqual(len(driver.find_lines(name + " refused")), 1, name)
        self.assertIn("refused", driver.fleet.wait("/hero_4", Robot.READY, "error", lambda e: e.last_error).last_error)

    def test_a_damaged_calibration_keeps_the_driver_from_nothing(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        Path(folder.name, "hero_5.yaml").write_bytes(b"\xff")
        Path(folder.name, "hero_6.yaml").mkdir()
        Path(folder.name, "hero_7.yaml").write_text("robot: hero_7\nwheels_m: [0.049, 0.049, 0.064]\n")
        driver = self.start(calibration_folder=folder.name)
        for number in (5, 6, 7):
            self.dial(driver, number)
        for number in (5, 6):
            driver.wait_line(r"a calibration is not used: .*hero_%d\.yaml" % number)
            self.assertIn("not calibrated: ", driver.fleet.find("/hero_%d" % number).last_error)
        self.assertEqual(driver.fleet.find("/hero_7").last_error, "")

    def declare_anew(self, driver, robot, **changes):
        """Let a robot come back with another declaration of its light, and of the service set_odom."""
        robot.close()
        driver.fleet.wait(robot.namespace, Robot.AWAY)
        robot.declarations = [
            entry._replace(**changes)
            if entry.name.endswith("/led") or (entry.kind == REQUESTS and entry.name.endswith("/set_odom"))
            else entry
            for entry in STOCK_DECLARATIONS
        ]
        robot.declarations = [entry._replace(name=entry.name.format(robot.name)) for entry in robot.declarations]
        robot.received.clear()
        robot.connect(driver.address)
        driver.fleet.wait_ready(robot.namespace)

    def assert_reached(self, robot, light, is_reached):
        """What is sent to a robot's light reaches it, or does not; what is sent after that to another topic does."""
        count = len(robot.payloads_on("laser_enable"))
        light.publish(ColorRGBA(1.0, 1.0, 1.0, 1.0))
        make_publisher("/%s/laser_enable" % robot.name, Bool).publish(Bool(True))
        wait_payloads(robot, "laser_enable", count + 1)
        if is_reached:
            wait_payloads(robot, "led")
        self.assertEqual(len(robot.payloads_on("led")), int(is_reached))

    def test_a_topic_redeclared_with_another_md5_gets_nothing_more(self):
        driver = self.share()
        robot = self.dial(driver, 11)
        robot.answers["set_odom"] = lambda request: encode_answer(True, "set")
        light = make_publisher("/hero_11/led", ColorRGBA)
        set_odom = rospy.ServiceProxy("/hero_11/set_odom", SetOdom)
        self.assert_reached(robot, light, True)
        rospy.wait_for_service("/hero_11/set_odom", 60.0)
        self.assertTrue(set_odom(0.0, 0.0, 0.0).success)
        self.declare_anew(driver, robot, md5sum=WRONG_MD5)
        for what in ("topic /hero_11/led", "service /hero_11/set_odom"):
            driver.wait_line("hero_11: %s refused: .*%s" % (what, WRONG_MD5))
            self.assertEqual(len(driver.find_lines(what)), 1)
        self.assert_reached(robot, light, False)
        with self.assertRaises(rospy.ServiceException):
            set_odom(0.0, 0.0, 0.0)
        self.assertEqual(robot.payloads_on("set_odom"), [])
        self.declare_anew(driver, robot)
        # The publisher may still hold the connection that the driver has closed, as rospy notices when it writes.
        light.unregister()
        self.assert_reached(robot, make_publisher("/hero_11/led", ColorRGBA), True)
        rospy.wait_for_service("/hero_11/set_odom", 60.0)
        self.assertTrue(set_odom(0.0, 0.0, 0.0).success)

    def test_a_topic_redeclared_with_another_type_gets_that_only(self):
        driver = self.share()
        robot = self.dial(driver, 12)
        light = make_publisher("/hero_12/led", ColorRGBA)
        self.assert_reached(robot, light, True)
        self.declare_anew(driver, robot, message_type="std_msgs/String", md5sum=STRING_MD5)
        driver.wait_line("hero_12: service /hero_12/set_odom refused: its halves are")
        self.assert_reached(robot, light, False)
        # rospy would not let this node publish a topic with two types.
        writer = subprocess.Popen(["rostopic", "pub", "/hero_12/led", "std_msgs/String", "red"])
        self.addCleanup(writer.wait)
        self.addCleanup(writer.terminate)
        self.assertEqual(wait_payloads(robot, "led"), [make_text("red")])

    def test_a_robot_cannot_put_anything_but_transforms_on_tf(self):
        wrong = [
            Declaration(PUB, 129, "/tf", "std_msgs/String", STRING_MD5) if entry.name == "/tf" else entry
            for entry in STOCK_DECLARATIONS
        ]
        driver = self.share()
        evil, good = self.dial(driver, 20, declarations=wrong), self.dial(driver, 21)
        transforms = Recorder("/tf", TFMessage)
        for _ in range(5):
            evil.send_packet(129, make_text("no transform"))
            stock_messages.send_burst(good, 0.0, 0.0)
        wait_for(
            lambda: sum(len(message.transforms) for message in list(transforms.messages)) == 25,
            lambda: "25 transforms in %s" % transforms.messages,
        )
        driver.wait_line("hero_20: topic '?/tf'? refused")


if __name__ == "__main__":
    rospy.init_node("test_driver_policy")
    rostest.rosrun("hero_driver", "driver_policy", TestDriverPolicy)
