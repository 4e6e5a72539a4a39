"""The program map_arena: which poses and ranges draw the map, what is published of it, and how it is saved."""

import math
from types import SimpleNamespace
from unittest.mock import create_autospec

import pytest
import yaml

pytest.importorskip("rospy", reason="the program needs ROS")
import rospy
from sensor_msgs.msg import LaserScan
from std_srvs.srv import TriggerRequest

from hero_client import ProgramError
from hero_localization.mapping.occupancy_grid import SwarmMap
from hero_localization.nodes import map_arena
from hero_localization.nodes.map_arena import PARAMETERS, PUBLISH_STEPS, MapNode
from hero_msgs.msg import RobotPose, RobotPoses
from hero_node.parameters import check_parameters

STAMP_S = 50


class Bench:
    """A map node, what it published, and whom it listens to."""

    def __init__(self, monkeypatch, folder, **given):
        self.sent, self.topics = {}, []
        monkeypatch.setattr(rospy, "Publisher", self.advertise)
        monkeypatch.setattr(rospy, "Subscriber", lambda topic, *_, **__: self.topics.append(topic))
        monkeypatch.setattr(rospy, "Service", lambda name, kind, serve: setattr(self, "serve", serve))
        monkeypatch.setattr(rospy, "get_rostime", lambda: rospy.Time(77))
        self.path = folder / "maps" / "arena.yaml"
        self.node = MapNode(check_parameters(PARAMETERS, {"file": str(self.path), **given}))

    def advertise(self, topic, message_class, queue_size, latch):
        assert latch
        messages = self.sent.setdefault(topic, [])
        return SimpleNamespace(publish=messages.append)

    def see(self, *robots):
        """Let localize report robots: (id, state, x)."""
        report = RobotPoses()
        report.header.frame_id = "map"
        report.robots = [
            RobotPose(id=number, state=state, x=x_m, stamp=rospy.Time(STAMP_S)) for number, state, x_m in robots
        ]
        self.node._receive_poses(report)

    def scan(self, robot_id, angle_min=0.0):
        """Let a robot see a wall 0.1 m ahead, and nothing else."""
        scan = LaserScan(ranges=[0.1] + [math.inf] * 7, angle_min=angle_min, angle_increment=math.pi / 4.0)
        scan.header.stamp = rospy.Time(STAMP_S)
        self.node._receive_ranges(robot_id, scan)


@pytest.fixture(name="bench")
def make_bench(monkeypatch, tmp_path):
    return Bench(monkeypatch, tmp_path)


def test_robots_draw_where_they_are_measured_alone(bench):
    swarm_map = bench.node._map = create_autospec(SwarmMap, instance=True)
    bench.see(
        (2, RobotPose.LOST, 0.1), (3, RobotPose.UNKNOWN, 0.1), (5, RobotPose.TRACKED, math.nan),
        (7, RobotPose.TRACKED, 0.25),
    )  # fmt: skip
    swarm_map.add_pose.assert_called_once_with(7, STAMP_S, (0.25, 0.0, 0.0))
    bench.scan(7)
    bench.scan(7, angle_min=math.nan)
    ((robot_id, stamp_s, ranges_m),) = [one.args for one in swarm_map.add_ranges.call_args_list]
    assert (robot_id, stamp_s) == (7, STAMP_S) and ranges_m[0] == pytest.approx(0.1)


def test_each_robot_that_localize_names_is_listened_to_once(bench):
    for _ in range(2):
        bench.see((2, RobotPose.LOST, 0.1), (9, RobotPose.TRACKED, 0.1))
    assert bench.topics == ["/localization/poses", "/hero_2/proximity", "/hero_9/proximity"]


def test_the_map_is_published_once_a_second_in_its_frame(bench):
    for _ in range(PUBLISH_STEPS):
        bench.node.step()
    assert not any(bench.sent.values()), "its frame is not known yet"
    bench.see((7, RobotPose.TRACKED, 0.25))
    bench.scan(7)
    for _ in range(2 * PUBLISH_STEPS):
        bench.node.step()
    message = bench.sent["/map"][-1]
    assert len(bench.sent["/map"]) == 2 == len(bench.sent["~frontiers"])
    assert message.header.frame_id == "map" and message.info.resolution == 0.01
    assert len(message.data) == message.info.width * message.info.height == 220 * 220
    assert (message.info.origin.position.x, message.info.origin.position.y) == pytest.approx((-1.1, -1.1))
    grid = bench.node._grid
    assert bench.sent["~known_share"][-1].data == pytest.approx(grid.known_share) and 0.0 < grid.known_share < 0.1
    assert bench.sent["~frontiers"][-1].header.frame_id == "map"
    assert len(bench.sent["~frontiers"][-1].poses) == len(grid.find_frontiers()) > 0


def test_a_map_is_saved_with_its_image_or_says_why_not(bench, monkeypatch):
    answer = bench.serve(TriggerRequest())
    image = bench.path.with_suffix(".png")
    assert answer.success and answer.message == f"{bench.path} and {image}" and image.is_file()
    content = yaml.safe_load(bench.path.read_text())
    assert content["image"] == "arena.png" and content["origin"] == [-1.1, -1.1, 0.0] and content["resolution"] == 0.01
    save = create_autospec(map_arena.save_map)
    monkeypatch.setattr(map_arena, "save_map", save)
    for error in (OSError(28, "No space left on device", "a.png"), OSError(28, "No space left on device")):
        save.side_effect = error
        answer = bench.serve(TriggerRequest())
        assert not answer.success
        assert answer.message == f"{error.filename or bench.path} cannot be written: No space left on device"
    assert not bench.node._lock.locked()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"file": "~/arena.png"}, "must end in .yaml"),
        ({"bounds_m": "0 0 0 1"}, "~bounds_m is '0 0 0 1', but must be"),
        ({"bounds_m": "0 0 1"}, "~bounds_m is"),
        ({"bounds_m": "0 0 1 nan"}, "~bounds_m is"),
        ({"bounds_m": "0 0 101 1"}, "up to 100 m wide"),
        ({"bounds_m": "a b c d"}, "~bounds_m is"),
    ],
)
def test_a_map_that_cannot_be_is_refused_by_name(monkeypatch, tmp_path, given, words):
    with pytest.raises(ProgramError, match=words):
        Bench(monkeypatch, tmp_path, **given)
