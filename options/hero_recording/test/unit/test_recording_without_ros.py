"""Bags without ROS: what stepped robots record, and what the reader of rosbags makes of any bag."""

import pytest
import rosbag
from roslib.message import get_message_class
from synthetic_bag import write_bag

from hero_recording.bags import plain_reader, ros_reader
from hero_recording.bags.tables import is_exported, read_rows
from hero_sim.stepped import StepSwarm

pytestmark = pytest.mark.option("rosbags.rosbag1")


def read_tables(reader, path):
    with reader.Reader(str(path)) as bag:
        wanted = [topic for topic, (kind, _) in bag.list_topics().items() if is_exported(topic, kind)]
        return bag.list_topics(), bag.find_span(), [read_rows(*message) for message in bag.read(wanted)]


def test_both_readers_give_the_same_tables(tmp_path):
    write_bag(tmp_path / "run.bag", seconds=2.0)
    topics, span, rows = read_tables(ros_reader, tmp_path / "run.bag")
    plain_topics, plain_span, plain_rows = read_tables(plain_reader, tmp_path / "run.bag")
    assert plain_topics == topics
    assert plain_span == pytest.approx(span, abs=0.05)
    assert len(plain_rows) == len(rows) > 100
    for ours, theirs in zip(plain_rows, rows):
        for (robot_id, kind, values), (their_id, their_kind, expected) in zip(ours, theirs):
            assert (robot_id, kind) == (their_id, their_kind)
            for value, wanted in zip(values, expected):  # numbers of other types
                assert value == wanted if isinstance(wanted, str) else value == pytest.approx(wanted, nan_ok=True)


def test_stepped_robots_record_what_ros_reads(tmp_path):
    from hero_recording.step_recorder import StepRecorder

    path = tmp_path / "stepped.bag"
    with StepSwarm(2, arena="maze") as swarm, StepRecorder(swarm.rows, range(2), str(path)) as recorder:
        swarm[1].drive(0.1, 0.2)
        swarm.sleep(2.0)
        recorder.close()
        swarm.sleep(1.0)
    with rosbag.Bag(str(path)) as bag:
        odometry = [message for _, message, _ in bag.read_messages(["/hero_1/odom"])]
        assert bag.get_message_count(["/tf_static"]) == bag.get_message_count(["/hero_sim/arena"]) == 1
        types = {connection.datatype: connection.md5sum for connection in bag._get_connections()}
    assert {"nav_msgs/Odometry", "tf2_msgs/TFMessage", "visualization_msgs/MarkerArray"} < set(types)
    assert types == {name: get_message_class(name)._md5sum for name in types}
    assert odometry[-1].header.stamp.to_sec() == pytest.approx(1600000002.0, abs=0.04)
    assert odometry[-1].pose.pose.position.x > 0.1
