"""The program localize: which robots it listens to, and what it takes of a report of all robots."""

import math
from unittest import mock

import pytest

pytest.importorskip("rospy", reason="the program needs ROS")
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from hero_client import ProgramError
from hero_localization.nodes import localize
from hero_msgs.msg import RobotPose, RobotPoses


@pytest.fixture(name="node")
def make_node(monkeypatch):
    """Return the program without topics, which knows hero_4 and hero_9."""
    for name in ("Outputs", "PoseInput", "SwarmLocalizer"):
        monkeypatch.setattr(localize, name, mock.create_autospec(getattr(localize, name)))
    monkeypatch.setattr(localize, "subscribe_odometry", mock.create_autospec(localize.subscribe_odometry))
    monkeypatch.setattr(localize.rospy, "Subscriber", mock.Mock())
    monkeypatch.setattr(localize.rospy, "get_time", lambda: 50.0)
    monkeypatch.setattr(localize.rospy, "logwarn_throttle", mock.Mock())
    parameters = {name: declared.default for name, declared in localize.PARAMETERS.items()}
    return localize.LocalizationNode({**parameters, "robots": [4, 9], "frame": "map", "pose_frame": ""})


def list_subscribed():
    return [call.args[0] for call in localize.subscribe_odometry.call_args_list]


def test_robots_that_join_are_added_beside_those_that_are_known(node):
    node._add_robots([4, 5, 9, 12])
    assert list_subscribed() == ["/hero_4", "/hero_9", "/hero_5", "/hero_12"]
    assert [call.args[0] for call in node._localizer.add_robots.call_args_list] == [[4], [9], [5], [12]]


def make_report(frame, *states):
    robots = [RobotPose(id=robot_id, state=state, x=0.1 * robot_id) for robot_id, state in states]
    report = RobotPoses(robots=robots)
    report.header.frame_id, report._connection_header = frame, {"callerid": "/track"}
    return report


def test_an_unknown_robot_in_a_report_does_not_keep_the_next_from_its_pose(node):
    node._localizer.add_measurement.return_value = []
    node._receive_swarm(make_report("map", (7, RobotPose.TRACKED), (4, RobotPose.LOST), (9, RobotPose.TRACKED)))
    ((robot_id, measured, now_s),) = [call.args for call in node._localizer.add_measurement.call_args_list]
    assert (robot_id, now_s) == (9, 50.0) and measured.pose.x_m == pytest.approx(0.9)
    assert node._localizer.distrust.call_args.args[1] == [4]
    assert set(node._unknown_s) == {7}


def test_a_pose_that_no_robot_can_have_keeps_no_other_of_its_image_away(node):
    node._localizer.add_measurement.return_value = []
    report = make_report("", (4, RobotPose.TRACKED), (9, RobotPose.TRACKED), (4, RobotPose.TRACKED))
    report.robots[0].x, report.robots[2].position_sd, report.robots[2].yaw_sd = math.nan, 0.003, 0.02
    assert not node._image_used.is_set()
    node._receive_swarm(report)
    assert node._image_used.is_set(), "the poses of an image are published at once"
    (first, one, _), (second, other, _) = [call.args for call in node._localizer.add_measurement.call_args_list]
    assert (first, one.is_systematic, second, other.is_systematic) == (9, False, 4, True)
    assert one.covariance.diagonal() == pytest.approx([0.002**2, 0.002**2, 0.01**2]), "that of the parameters"
    assert other.covariance.diagonal() == pytest.approx([0.003**2, 0.003**2, 0.02**2])


def test_a_report_in_another_frame_is_left_alone_and_told(node):
    node._receive_swarm(make_report("odom", (9, RobotPose.TRACKED)))
    assert not node._localizer.add_measurement.called
    assert "'odom', but must be in 'map'" in localize.rospy.logwarn_throttle.call_args.args[1]


def test_cameras_are_where_their_programs_publish_them_in_the_common_frame(node):
    node._localizer.heights = mock.Mock(cameras_m={})
    transforms = [
        TransformStamped(Header(frame_id=frame), "x", Transform(Vector3(*place_m), Quaternion(0.0, 0.0, 0.0, 1.0)))
        for frame, place_m in (("hero_0/base_link", (1.0, 1.0, 1.0)), ("map", (0.1, -0.2, 2.2)))
    ]
    message = TFMessage(transforms)
    message._connection_header = {"callerid": "/track_2"}
    node._note_cameras(message)
    assert {name: place_m.tolist() for name, place_m in node._localizer.heights.cameras_m.items()} == {
        "/track_2": [0.1, -0.2, pytest.approx(2.124)]
    }


def test_diagnostics_name_tags_of_unknown_robots_each_second_for_three(node, monkeypatch):
    drivers = mock.Mock()
    drivers.read.side_effect = [None, *[mock.Mock(robots=[mock.Mock(id=5), mock.Mock(id=-1)])] * 9]
    monkeypatch.setattr(localize, "share_drivers", lambda: drivers)
    monkeypatch.setattr(localize.rospy, "loginfo", mock.Mock())
    node._chosen, node._localizer.find_lost.return_value = None, ["hero_4 lost"]
    node._localizer.add_measurement.return_value = []
    node._localizer.list_source_problems.return_value = {"clock of /track": "late"}
    node._receive_swarm(make_report("map", (7, RobotPose.TRACKED), (5, RobotPose.TRACKED)))
    told = []
    for now_s in (50.0, 50.5, 51.0, 52.9, 53.9, 49.0):
        monkeypatch.setattr(localize.rospy, "get_time", lambda now_s=now_s: now_s)
        node._outputs.publish_diagnostics.reset_mock()
        node._image_used.set()
        node.step(9.0)
        is_due = node._outputs.publish_diagnostics.called
        assert node._localizer.list_robots.call_args.args == (now_s, False, is_due)
        assert not node._image_used.is_set(), "it waits for the next image"
        if is_due:
            robots, unknown, problems = node._outputs.publish_diagnostics.call_args.args
            assert robots is node._localizer.list_robots.return_value and problems == {"clock of /track": "late"}
            told.append((now_s, unknown))
    assert told == [(50.0, [5, 7]), (51.0, [7]), (52.9, [7]), (53.9, []), (49.0, [7])], "also after time went back"
    assert list_subscribed() == ["/hero_4", "/hero_9", "/hero_5"]
    assert node._outputs.publish.call_count == 6
    localize.rospy.loginfo.assert_called_with("hero_4 lost")


@pytest.mark.parametrize(("given", "used"), [("/world/hero_{id}/pose", "/world/hero_4/pose"), ("/hero_0/pose", None)])
def test_a_topic_of_measured_poses_holds_the_id(node, given, used):
    parameters = {name: declared.default for name, declared in localize.PARAMETERS.items()}
    parameters = {**parameters, "robots": [4], "pose_topic": given, "frame": "/map", "pose_frame": "/world"}
    if used is None:
        with pytest.raises(ProgramError, match=r"~pose_topic is '/hero_0/pose', but must hold \{id\}"):
            localize.LocalizationNode(parameters)
    else:
        localize.LocalizationNode(parameters)
        assert localize.PoseInput.call_args.args[:2] == (used, "world") and localize.Outputs.call_args.args == ("map",)
