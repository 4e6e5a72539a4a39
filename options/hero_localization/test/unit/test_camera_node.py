"""The node of the simulated camera: its options, the robots' true poses, and the board that it shows."""

import math
import sys

import numpy as np
import pytest

pytest.importorskip("cv2")

from hero_localization.errors import SettingsError
from hero_localization.simulated_camera import camera_node
from hero_localization.simulated_camera.view import CameraOptions, PrintedTag
from hero_node import run


def test_wrong_ids_are_reported_in_one_line(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["simulated_camera", "--first-id", "200"])
    with pytest.raises(SystemExit) as end:
        run(camera_node.main)
    assert end.value.code == 1
    assert capsys.readouterr().err == "simulated_camera: tags from 100 on are reference tags: take lower ids\n"


def test_a_camera_with_fewer_pixels_sees_the_same():
    small = camera_node.scale(CameraOptions(), 960, 540)
    points_m = np.array([(0.7, -0.3, 0.076), (-1.0, 0.5, 0.0)])
    large_px, small_px = (options.geometry.project(points_m) for options in (CameraOptions(), small))
    assert small_px + 0.5 == pytest.approx((large_px + 0.5) / 2.0)
    assert (small.width_px, small.height_px, small.blur_px) == (960, 540, 0.35)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--count", "501"], "--count: 501 must be a whole number from 1 to 500"),
        (["--first-id", "-1"], "--first-id: -1 must be"),
        (["--width", "159"], "--width: 159 must be a whole number from 160 to 4096"),
        (["--rate", "0.4"], "--rate: 0.4 must be a number from 0.5 to 120"),
        (["--delay", "5.1"], "--delay: 5.1 must be a number from 0 to 5"),
        (["--exposure", "0.11"], "--exposure: 0.11 must be a number from 0 to 0.1"),
        (["--tag-size", "nan"], "--tag-size: nan must be a number from 0.01 to 0.2"),
        (["--part", "0", "2"], "--part: 0 must be a whole number from 1 to 4"),
        (["--part", "3", "2"], "--part 3 2: there are no more parts"),
    ],
)
def test_options_beyond_their_limits_are_named(arguments, words, capsys):
    with pytest.raises(SystemExit):
        camera_node.parse_options(arguments)
    assert words in capsys.readouterr().err


def test_the_camera_is_a_webcam_above_a_lab():
    assert CameraOptions() == (
        1920, 1080, (1390.0, 1390.0), (948.0, 551.0), (-0.09, 0.02, 0.0006, -0.0004, 0.0),
        (0.03, -0.02, 2.2), (0.02, -0.015, 0.01), 0.7, 3.0, 0.35, 0.008, 30.0, 0.07, 0.01, 0.02,
    )  # fmt: skip
    assert PrintedTag(5) == (5, 0.04, 0.076, 0.0, 0.0, 0.0, "36h11")
    options = vars(camera_node.parse_options([]))
    names = ("count", "first_id", "width", "rate", "delay", "exposure", "tag_size", "seed", "stamps", "part")
    assert tuple(options[name] for name in names) == (1, 0, 1920, 30.0, 0.07, 0.008, 0.04, 0, "capture", (1, 1))


def test_options_are_taken_up_to_their_limits():
    for name, low, high in (
        ("count", 1, 500), ("first-id", 0, 500), ("width", 160, 4096), ("rate", 0.5, 120.0),
        ("delay", 0.0, 5.0), ("exposure", 0.0, 0.1), ("tag-size", 0.01, 0.2),
    ):  # fmt: skip
        step = 1 if isinstance(low, int) else 0.001
        for value in (low, high):
            camera_node.parse_options(["--" + name, str(value)])
        for value in (low - step, high + step):
            with pytest.raises(SystemExit):
                camera_node.parse_options(["--" + name, str(value)])


def test_references_are_printed_for_the_camera_file(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["simulated_camera", "--print-references", "--arena", "empty"])
    camera_node.main()
    assert capsys.readouterr().out.startswith("references: {100: [-1.120, -0.800, 0], 101: ")
    monkeypatch.setattr(sys, "argv", ["simulated_camera", "--print-references", "--first-id", "90", "--count", "10"])
    camera_node.main()
    monkeypatch.setattr(sys, "argv", ["simulated_camera", "--print-references", "--first-id", "91", "--count", "10"])
    with pytest.raises(SettingsError, match="tags from 100 on"):
        camera_node.main()


def test_true_robots_are_moved_on_from_their_newest_messages(monkeypatch):
    subscribed, ids = {}, []

    def subscribe(topic, kind, receive, robot_id, queue_size, tcp_nodelay):
        assert kind is camera_node.Odometry and tcp_nodelay
        ids.append(robot_id)
        subscribed[topic] = lambda message: receive(message, robot_id)

    monkeypatch.setattr(camera_node.rospy, "Subscriber", subscribe)
    camera_node.TrueRobots([9, 3])
    assert list(subscribed) == ["/hero_9/ground_truth", "/hero_3/ground_truth"] and ids == [9, 3]
    true = camera_node.TrueRobots([7])

    def receive(stamp_s, x_m):
        message = camera_node.Odometry()
        message.header.stamp = camera_node.rospy.Time.from_sec(stamp_s)
        message.pose.pose.position.x, message.pose.pose.position.y = x_m, 2.0
        message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(0.5), math.cos(0.5)
        message.twist.twist.linear.x, message.twist.twist.angular.z = 0.2, 1.0
        subscribed["/hero_7/ground_truth"](message)

    assert true.find(1.0) is None
    for index in range(30):
        receive(1.0 + 0.5 * index, float(index))
    for stamp_s, x_m, moved_s in ((6.0, 10.0, 0.0), (5.0, 10.0, -0.1), (6.05, 10.0, 0.05), (15.2, 28.0, 0.1),
                                  (15.7, 29.0, 0.1), (15.42, 29.0, -0.08)):  # fmt: skip
        poses, speeds = true.find(stamp_s)
        heading_rad = 1.0 + moved_s / 2.0
        moved_m = 0.2 * moved_s
        expected = (x_m + moved_m * math.cos(heading_rad), 2.0 + moved_m * math.sin(heading_rad), 1.0 + moved_s)
        assert speeds.tolist() == [[0.2, 1.0]]
        assert poses[0] == pytest.approx(expected), stamp_s


def test_a_hand_is_where_it_is_told_until_either_number_is_none():
    node = camera_node.CameraNode.__new__(camera_node.CameraNode)
    seen = []
    for place_m in ((0.1, -0.2), (0.3, math.nan), (0.1, 0.2), (math.nan, 0.0), (0.0, math.inf)):
        node._receive_hand(camera_node.Point(*place_m, 0.5))
        seen.append(node._hand_m)
    assert seen == [(0.1, -0.2), None, (0.1, 0.2), None, None]


@pytest.mark.parametrize("stamps_arrival", [False, True])
def test_images_go_on_when_the_clock_is_set(monkeypatch, stamps_arrival):
    now_s, ahead_s, published = [50.0], [1000.0], []
    node = camera_node.CameraNode.__new__(camera_node.CameraNode)
    node._options, node._seed, node._stamps_arrival = CameraOptions(delay_s=0.1, dropped_share=0.0), 0, stamps_arrival

    def publish(stamp, taken_s):
        published.append((now_s[0], stamp.to_sec() - now_s[0] - ahead_s[0], taken_s - now_s[0] - ahead_s[0]))
        ahead_s[0] = 4600.0 - ahead_s[0]  # back and forth by an hour

    def sleep(duration_s):
        now_s[0] += duration_s

    monkeypatch.setattr(node, "_publish", publish)
    monkeypatch.setattr(camera_node, "read_duration_clock_s", lambda: now_s[0])
    monkeypatch.setattr(camera_node.rospy, "get_time", lambda: now_s[0] + ahead_s[0])
    monkeypatch.setattr(camera_node.rospy, "sleep", sleep)
    monkeypatch.setattr(camera_node.rospy, "is_shutdown", lambda: len(published) >= 30)
    node.run()
    times_s, stamps_s, taken_s = np.array(published).T
    assert times_s[-1] - 50.0 == pytest.approx(29 / 30.0 + 0.1, abs=0.03)
    assert ((taken_s > -0.13) & (taken_s < -0.09)).all()
    assert stamps_s == pytest.approx(np.zeros(30) if stamps_arrival else taken_s, abs=1e-6)
