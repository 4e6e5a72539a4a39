"""Markers of names, rings and lights, as RViz draws them."""

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from types import SimpleNamespace

import pytest

lights = pytest.importorskip("hero_description.lights", reason="imports rospy")
from geometry_msgs.msg import PointStamped, PoseStamped, TransformStamped  # noqa: E402
from std_msgs.msg import ColorRGBA  # noqa: E402
from visualization_msgs.msg import Marker  # noqa: E402

from hero_description import goal_choice  # noqa: E402

BODY_RADIUS_M, HAT_Z_M, LIGHT_S = 0.037, 0.051, 15.0
URDF = ElementTree.parse(str(Path(__file__).resolve().parents[2] / "urdf" / "hero.urdf")).getroot()


def test_a_ring_is_closed_and_lies_around_the_body():
    _, ring = lights.make_identity(7)
    angles_rad = [math.atan2(point.y, point.x) % math.tau for point in ring.points]
    radii_m = [math.hypot(point.x, point.y) for point in ring.points]
    assert radii_m == pytest.approx([lights.RING_RADIUS_M] * len(radii_m))
    assert BODY_RADIUS_M + 0.004 < lights.RING_RADIUS_M - ring.scale.x / 2 < lights.RING_RADIUS_M < 2 * BODY_RADIUS_M
    steps_rad = {round((after - before) % math.tau, 6) for before, after in zip(angles_rad, angles_rad[1:])}
    assert steps_rad == {round(math.tau / (len(radii_m) - 1), 6)}
    assert math.degrees(steps_rad.pop()) == pytest.approx(15.0, abs=1e-3)
    assert {point.z for point in ring.points} == {0.0} and ring.type == Marker.LINE_STRIP
    assert (ring.color.a, ring.pose.orientation.w, ring.frame_locked) == (1.0, 1.0, True)


def test_lights_names_and_rings_of_a_simulated_robot_are_where_it_is():
    markers = [lights.make_light(7, ColorRGBA(1.0, 0.0, 0.0, 1.0), "true/"), *lights.make_identity(7, "true/")]
    frames = [marker.header.frame_id for marker in markers]
    assert frames == ["hero_7/true/hat_link", "hero_7/true/base_link", "hero_7/true/base_link"]


def test_a_name_stands_above_the_hat_in_dark_letters():
    name, _ = lights.make_identity(7)
    assert HAT_Z_M + name.scale.z / 2 < name.pose.position.z < 0.2
    assert name.scale.z > 0.01
    assert max(name.color.r, name.color.g, name.color.b) < 0.2
    assert (name.color.a, name.pose.orientation.w, name.frame_locked) == (1.0, 1.0, True)


def test_a_light_has_its_color_for_as_long_as_the_firmware_shows_it():
    light = lights.make_light(3, ColorRGBA(0.0, 0.5, 0.0, 0.2))
    assert (light.color.r, light.color.g, light.color.b, light.color.a) == (0.0, 0.5, 0.0, 1.0)
    assert (light.action, light.header.frame_id) == (light.ADD, "hero_3/hat_link")
    assert light.lifetime.to_sec() == LIGHT_S
    assert light.scale.x == light.scale.y == light.scale.z
    assert 0.01 < light.scale.x < 2 * BODY_RADIUS_M
    dark = URDF.find("link[@name='hat_link']/visual[@name='light']")
    assert light.pose.position.z == float(dark.find("origin").get("xyz").split()[2])
    assert 2.0 * float(dark.find("geometry/sphere").get("radius")) < light.scale.x < 0.03, "covers the dark one"
    assert lights.make_light(3, ColorRGBA(0.0, 0.0, 0.0, 1.0)).action == light.DELETE
    for color in (ColorRGBA(0.1, 0.0, 0.0, 1.0), ColorRGBA(0.0, 0.0, 0.1, 1.0)):
        assert lights.make_light(3, color).action == light.ADD


LINE_Y_M = 0.7


class Stage:
    """Robots on a line along x, 0.3 m apart, in place of all that goal_choice has of ROS."""

    def __init__(self, monkeypatch, count=3, connections=1):
        self.sent, self.told, self.latched = {}, [], []
        self.known = {"hero_%d/base_link" % number: 0.3 * number for number in range(count)}
        rospy = goal_choice.rospy
        monkeypatch.setattr(rospy, "Publisher", self.advertise)
        monkeypatch.setattr(rospy, "Subscriber", lambda *arguments, **options: None)
        self.slept_s = 0.0
        monkeypatch.setattr(rospy, "sleep", lambda duration_s: setattr(self, "slept_s", duration_s))
        for name in ("loginfo", "logwarn", "logdebug"):
            monkeypatch.setattr(rospy, name, lambda text, *values: self.told.append(text % values))
        listener = SimpleNamespace(unregister=lambda: None)
        monkeypatch.setattr(goal_choice.tf2_ros, "Buffer", lambda **options: self)
        monkeypatch.setattr(goal_choice.tf2_ros, "TransformListener", lambda *arguments, **options: listener)
        self.connections = connections
        self.choice = goal_choice.GoalChoice(["hero_%d" % number for number in range(count)])

    def advertise(self, topic, kind, queue_size, latch=False):
        messages = self.sent.setdefault(topic, [])
        self.latched += [topic] if latch else []
        return SimpleNamespace(publish=messages.append, get_num_connections=lambda: self.connections)

    def lookup_transform(self, target, source, time):
        if source not in self.known or not self.slept_s:
            raise goal_choice.tf2_ros.LookupException("no %s" % source)
        transform = TransformStamped()
        transform.transform.translation.x, transform.transform.translation.y = self.known[source], LINE_Y_M
        return transform

    def click(self, x_m, y_m=0.0):
        point = PointStamped()
        point.point.x, point.point.y = x_m, LINE_Y_M + y_m
        self.choice._receive_point(point)
        return self.discs[-1].header.frame_id

    @property
    def discs(self):
        return [marker for array in self.sent["/hero_choice/chosen"] for marker in array.markers]


def test_a_click_near_a_robot_chooses_the_nearest_and_goals_go_to_it(monkeypatch):
    stage = Stage(monkeypatch)
    assert [disc.header.frame_id for disc in stage.discs] == ["hero_0/base_link"], "the first one at first"
    assert stage.latched == ["/hero_choice/chosen"]
    clicks = ((0.4, 0.0, 1), (0.47, 0.0, 2), (0.6, 0.149, 2), (0.0, 0.151, 2), (0.09, -0.12, 2), (0.08, -0.12, 0))
    for x_m, y_m, chosen in clicks:
        assert stage.click(x_m, y_m) == "hero_%d/base_link" % chosen, (x_m, y_m)
    assert "no robot where you clicked; goals go to hero_2" in stage.told
    del stage.known["hero_0/base_link"]
    assert stage.click(0.2) == "hero_1/base_link", "of those that are known"
    stage.known.clear()
    assert stage.click(0.0) == "hero_1/base_link"
    goal = PoseStamped()
    stage.choice._receive_goal(goal)
    assert stage.sent["/hero_1/goal"] == [goal] and not stage.sent["/hero_0/goal"]
    assert not any("no program" in text for text in stage.told)


def test_a_goal_that_no_program_takes_is_told_with_the_remedy(monkeypatch):
    stage = Stage(monkeypatch, connections=0)
    stage.choice._receive_goal(PoseStamped())
    assert stage.told == ['no program takes goals for hero_0: roslaunch hero_examples go_to_goal.launch robots:="0"']
    assert len(stage.sent["/hero_0/goal"]) == 1


def test_the_disc_of_the_chosen_robot_lies_on_the_ground_around_its_ring(monkeypatch):
    (disc,) = Stage(monkeypatch).discs
    wheel = URDF.find("link[@name='left_wheel_link']/collision/geometry/cylinder")
    axle = URDF.find("joint[@name='left_wheel_joint']/origin").get("xyz").split()
    assert disc.pose.position.z == pytest.approx(float(axle[2]) - float(wheel.get("radius")))
    _, ring = lights.make_identity(0)
    assert 2.0 * lights.RING_RADIUS_M + ring.scale.x < disc.scale.x == disc.scale.y < 0.15
    assert 0.0 < disc.scale.z <= 0.001 and (disc.type, disc.frame_locked) == (Marker.CYLINDER, True)
    color = disc.color
    assert color.r < 0.1 < 2.0 * color.g < color.b <= 1.0 and 0.5 < color.a < 1.0 and disc.pose.orientation.w == 1.0
