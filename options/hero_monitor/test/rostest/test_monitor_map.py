#!/usr/bin/env python3
"""The map while robots are localized: one frame for all of them, and on request the camera's picture."""

import colorsys
import io
import math
import unittest

import rospy
import rostest
from geometry_msgs.msg import Point, Point32, Polygon, PolygonStamped, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
from monitor_process import HOST, end, start_scripted_driver, wait_until_it_answers
from nav_msgs.msg import Odometry
from PIL import Image
from sensor_msgs.msg import CompressedImage
from visualization_msgs.msg import Marker, MarkerArray

from hero_msgs.msg import RobotPose, RobotPoses
from hero_test.screens.browser import MISSING
from hero_test.screens.monitor_page import MonitorPage
from hero_test.waiting import wait_for

COLORS = {"red": (255, 0, 0), "green": (0, 160, 0), "blue": (0, 0, 255), "magenta": (255, 0, 255)}
"""Of the picture's quarters: upper left, upper right, lower left, lower right."""

HERO_0 = [255.0 * part for part in colorsys.hls_to_rgb(24 / 360, 0.42, 0.7)]

STEP_PX = 4
"""Between the pixels that are looked at."""

FIND_COLORS = """
const [colors, step] = arguments, found = {};
const canvas = document.getElementById("canvas"), { width, height } = canvas;
const data = canvas.getContext("2d").getImageData(0, 0, width, height).data;
for (let row = 0; row < height; row += step) for (let column = 0; column < width; column += step) {
  const at = 4 * (row * width + column);
  for (const [name, color] of colors) {
    if (color.some((value, part) => Math.abs(data[at + part] - value) > 12)) continue;
    const box = (found[name] = found[name] || { left: column, right: column, top: row, bottom: row });
    [box.left, box.right] = [Math.min(box.left, column), Math.max(box.right, column)];
    box.bottom = row;
  }
}
return found;
"""

MEASURE_COLOR = """
const [color, step] = arguments, canvas = document.getElementById("canvas"), { width, height } = canvas;
const data = canvas.getContext("2d").getImageData(0, 0, width, height).data;
let [count, x, y] = [0, 0, 0];
for (let row = 0; row < height; row += step) for (let column = 0; column < width; column += step) {
  const at = 4 * (row * width + column);
  if (color.some((value, part) => Math.abs(data[at + part] - value) > 12)) continue;
  [count, x, y] = [count + 1, x + column, y + row];
}
return [(count * step * step) / (width * height), x / (count || 1) / width, y / (count || 1) / height];
"""

COUNT_FETCHES = "return performance.getEntriesByType('resource').filter((one) => one.name.includes('/picture/')).length"


def make_jpeg():
    """Return a picture of 400 x 200 pixels with a color in each quarter."""
    picture = Image.new("RGB", (400, 200))
    for index, color in enumerate(COLORS.values()):
        picture.paste(color, (index % 2 * 200, index // 2 * 100, index % 2 * 200 + 200, index // 2 * 100 + 100))
    file = io.BytesIO()
    picture.save(file, "JPEG", quality=95, subsampling=0)
    return file.getvalue()


class Repeater:
    """Publishes a message ten or more times a second, until its end."""

    def __init__(self, topic, message, period_s=0.1):
        self.publisher = rospy.Publisher(topic, type(message), queue_size=2)
        self.timer = rospy.Timer(rospy.Duration.from_sec(period_s), lambda event: self.publisher.publish(message))

    def close(self):
        self.timer.shutdown()
        self.timer.join()
        self.publisher.unregister()


@unittest.skipIf(MISSING, "not installed: %s (script/bootstrap --test)" % ", ".join(MISSING))
class MapTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        wait_until_it_answers(HOST)
        cls.driver = start_scripted_driver("hero_driver", [0, 1])
        cls.page = MonitorPage("http://%s/" % HOST)
        cls.page.open()
        cls.page.wait_for_text("#ready", "2 of 2")
        odometry = Odometry()
        odometry.pose.pose.position, odometry.pose.pose.orientation = Point(0.25, 0.0, 0.0), Quaternion(w=1.0)
        cls.odometry = Repeater("/hero_0/odom", odometry)
        poses = RobotPoses(
            robots=[
                RobotPose(id=0, state=RobotPose.TRACKED, x=-0.9, y=0.4, yaw=math.pi / 2.0),
                RobotPose(id=1, state=RobotPose.UNKNOWN, x=math.nan, y=math.nan, yaw=math.nan),
            ]
        )
        poses.header.frame_id = "map"
        cls.poses = poses
        cls.page.choose("hero_0")

    @classmethod
    def tearDownClass(cls):
        cls.odometry.close()
        cls.page.close()
        end(cls.driver)

    def wait_for_facts(self, pose, source):
        def are_shown():
            facts = self.page.facts()
            return facts.get("pose", "").startswith(pose) and facts.get("pose source") == source

        wait_for(are_shown, "pose %s by %s" % (pose, source))

    def find_colors(self):
        """Return left, right, top and bottom (px) of each of COLORS that the map shows."""
        return self.page.browser.execute_script(FIND_COLORS, list(COLORS.items()), STEP_PX)

    def find_all_colors(self):
        """Return what find_colors does once it is complete."""
        found = self.find_colors()
        return found if len(found) == len(COLORS) else None

    def test_localized_robots_are_drawn_in_their_frame_while_it_lasts(self):
        alone = "own odometry: position on the map unknown"
        self.wait_for_facts("-0.250 0.000 m, 0", alone)
        self.page.wait_for_text("#frame", "frame world, odometry drifts")
        localization = Repeater("/localization/poses", self.poses)
        self.wait_for_facts("-0.900 0.400 m, 90", "camera")
        self.page.wait_for_text("#frame", "frame map, localized")
        self.page.choose("hero_1")
        wait_for(lambda: self.page.facts().get("pose source") == alone, "a robot without a transform")
        self.page.choose("hero_0")
        poses = self.poses.robots[0]
        poses.state = RobotPose.LOST
        self.wait_for_facts("-0.900 0.400 m, 90", "odometry")
        self.page.wait_for_text("#losses", "The camera measures no robot")
        poses.state = RobotPose.TRACKED
        wait_for(lambda: not self.page.text("#losses"), "the camera")
        localization.close()
        self.wait_for_facts("-0.900 0.400 m, 90", "unknown")
        self.page.wait_for_text("#losses", "Localization is silent: positions are unknown")
        self.page.wait_for_text("#link", "localization lost")
        self.wait_for_facts("-0.250 0.000 m, 0", alone)
        self.page.wait_for_text("#frame", "frame world, odometry drifts")

    def test_the_cameras_picture_lies_at_its_place_while_it_is_switched_on(self):
        outline = PolygonStamped(polygon=Polygon([Point32(x, y, 0.0) for x in (-1.0, 1.0) for y in (-0.5, 0.5)]))
        outline.header.frame_id = "map"
        places = rospy.Publisher("/track/picture/outline", PolygonStamped, queue_size=1, latch=True)
        places.publish(outline)
        picture = Repeater("/track/picture/compressed", CompressedImage(data=make_jpeg()), 0.05)
        self.assertEqual(picture.publisher.get_num_connections(), 0)
        self.page.click("#picture")
        hint = self.page.find("#no_picture")
        wait_for(lambda: picture.publisher.get_num_connections() == 1, "the subscription")
        self.assertTrue(hint.is_displayed(), "it has no place on the map of robots by odometry")
        self.assertEqual(self.find_colors(), {})
        localization = Repeater("/localization/poses", self.poses)
        found = wait_for(self.find_all_colors, "a picture on the map")
        self.assertFalse(hint.is_displayed())
        self.page.save("monitor_picture.png")
        red, green, blue, magenta = (found[name] for name in COLORS)
        self.assertLess(max(red["right"], blue["right"]), min(green["left"], magenta["left"]))
        self.assertLess(max(red["bottom"], green["bottom"]), min(blue["top"], magenta["top"]))
        for quarter in (green, blue, magenta):  # the robot lies on the other one
            width, height = quarter["right"] - quarter["left"], quarter["bottom"] - quarter["top"]
            self.assertAlmostEqual(width / height, 2.0, delta=0.1)
        fetches = self.page.run(COUNT_FETCHES)
        wait_for(lambda: self.page.run(COUNT_FETCHES) > fetches + 3, "more pictures")
        self.page.click("#picture")
        wait_for(lambda: picture.publisher.get_num_connections() == 0, "the end of the subscription")
        wait_for(lambda: self.find_colors() == {}, "a map without picture")
        self.page.click("#picture")
        wait_for(self.find_all_colors, "the picture again")
        picture.close()
        wait_for(hint.is_displayed, "the hint that there is none")
        self.page.click("#picture")
        self.assertFalse(hint.is_displayed())
        localization.close()
        self.assertEqual(self.page.errors(), [])

    def test_simulated_robots_are_drawn_where_they_are(self):
        self.page.click("#ghosts")
        place = PoseMessage(Point(2.0, 0.0, 0.0), Quaternion(w=1.0))
        markers = [Marker(ns=name, text="hero_0", pose=place) for name in ("headings", "names")]
        simulator = Repeater("/hero_sim/markers", MarkerArray(markers))
        self.addCleanup(simulator.close)
        # The view fits the robot and, to its left, its ghost.
        wait_for(lambda: self.measure_robot() > 0.6, self.measure_robot)
        self.page.save("monitor_ghost.png")
        wait_for(lambda: self.page.facts().get("odometry error") == "2250 mm", self.page.facts)
        simulator.close()
        wait_for(lambda: 0.4 < self.measure_robot() < 0.6, self.measure_robot)
        self.page.click("#ghosts")

    def measure_robot(self):
        """Return where hero_0 is, by the map's width; 0 if it is not drawn."""
        return self.page.browser.execute_script(MEASURE_COLOR, HERO_0, 1)[1]


if __name__ == "__main__":
    rospy.init_node("test_monitor_map")
    rostest.rosrun("hero_monitor", "test_monitor_map", MapTest)
