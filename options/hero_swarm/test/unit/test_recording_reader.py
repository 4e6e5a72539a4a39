"""Recordings for the fit: which rows of a bag are whose, and bags that cannot be used."""

import math

import numpy as np
import pytest
import rosbag
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from hero_msgs.msg import Motor, RobotPose, RobotPoses
from hero_recording.errors import RecordingError
from hero_swarm.experiments.errors import ExperimentError
from hero_swarm.fit import read_recordings
from hero_swarm.fitting.recording import PULSES, VELOCITY

START_S = 1000.0


def stamp(time_s):
    return rospy.Time.from_sec(START_S + time_s)


def make_odometry(time_s, x_m):
    message = Odometry()
    message.header.stamp, message.pose.pose.position.x = stamp(time_s), x_m
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(0.1), math.cos(0.1)
    return message


def write(path, *messages):
    with rosbag.Bag(str(path), "w") as bag:
        for topic, message, time_s in messages:
            bag.write(topic, message, stamp(time_s))
    return [str(path)]


def make_messages(robot_id, jump_m=0.0):
    name, twist = "/hero_%d/" % robot_id, Twist()
    twist.linear.x, twist.angular.z = 0.1, -0.5
    tracked = RobotPose(id=robot_id, stamp=stamp(0.1), x=1.0, y=2.0, yaw=0.3, state=RobotPose.TRACKED)
    lost = RobotPose(id=robot_id, stamp=stamp(0.2), x=9.0, state=RobotPose.UNKNOWN)
    return [
        (name + "odom", make_odometry(0.0, 0.0), 0.01),
        (name + "velocity_controller/cmd_vel", twist, 0.05),
        (name + "cmd_motor", Motor(1510, 1490), 0.08),
        (name + "odom", make_odometry(0.1, 0.01 + jump_m), 0.12),
        (name + "ground_truth", make_odometry(0.1, 5.0), 0.12),
        ("/localization/poses", RobotPoses(robots=[tracked, lost]), 0.2),
    ]


def test_each_robot_has_its_own_rows(tmp_path):
    paths = write(tmp_path / "a.bag", *make_messages(0), *make_messages(7))
    found = read_recordings(paths)
    assert sorted(found) == [0, 7]
    (recording,) = found[7]
    assert recording.commands == pytest.approx(np.array([(0.05, VELOCITY, 0.1, -0.5), (0.08, PULSES, 1510, 1490)]))
    assert recording.odometry == pytest.approx(np.array([(0.0, 0.0, 0.0, 0.2), (0.1, 0.01, 0.0, 0.2)]))
    assert recording.poses == pytest.approx(np.array([(0.1, 1.0, 2.0, 0.3)])), "a lost robot's pose is none"
    assert len(read_recordings(paths * 2)[0]) == 2


def test_without_localization_ground_truth_counts(tmp_path):
    paths = write(tmp_path / "a.bag", *make_messages(0)[:-1])
    assert read_recordings(paths)[0][0].poses == pytest.approx(np.array([(0.1, 5.0, 0.0, 0.2)]))


def test_recordings_that_cannot_be_used_are_refused_in_one_line(tmp_path):
    with pytest.raises(ExperimentError, match="hero_0: its odometry jumps"):
        read_recordings(write(tmp_path / "a.bag", *make_messages(0, jump_m=1.0)))
    with pytest.raises(ExperimentError, match="b.bag: no robot with odometry, commands and poses"):
        read_recordings(write(tmp_path / "b.bag", *make_messages(0)[:2]))
    (tmp_path / "c.bag").write_text("no bag")
    for name in ("c.bag", "none.bag"):
        with pytest.raises(RecordingError, match=name):
            read_recordings([str(tmp_path / name)])


@pytest.mark.parametrize("ahead_s", [86_400.0, 4_294_967_295.0 - START_S, -500.0])
def test_stamps_outside_of_the_recording_are_left_out_and_named(ahead_s, tmp_path, capsys):
    messages = make_messages(7)
    messages.append(("/hero_7/odom", make_odometry(ahead_s, 0.02), 0.2))
    (recording,) = read_recordings(write(tmp_path / "a.bag", *messages))[7]
    assert recording.time_s == pytest.approx(0.1)
    assert "hero_7: left out 1 of odometry with stamps outside of the recording" in capsys.readouterr().err


def test_a_recording_of_more_than_an_hour_is_refused(tmp_path):
    with pytest.raises(ExperimentError, match="it lasts 3601 s, but the fit takes at most 3600 s"):
        read_recordings(write(tmp_path / "a.bag", *make_messages(7), ("/hero_7/odom", make_odometry(0.0, 0.0), 3601.0)))
