"""Publishers whose commands no robot hears are named, and what they mean."""

from unittest.mock import create_autospec

import pytest

from hero_client.ros import lost_commands
from hero_node.ros import ask_master

TWIST = "geometry_msgs/Twist"
DRIVER = [["/hero_3/velocity_controller/cmd_vel", ["/hero_driver"]], ["/hero_3/cmd_vel", ["/hero_driver"]]]
HEARD = [["/clock", ["/simulator"]], ["/hero_3/odom", ["/hero_driver"]]]


@pytest.fixture(name="find")
def fixture_find(monkeypatch):
    """Return a function that has the master list a topic, and returns the lost commands."""
    monkeypatch.setattr(lost_commands.rospy, "get_name", lambda: "/asking")

    def find(topic, kind, node="/mine", subscribed=()):
        answers = {
            "getSystemState": ([[topic, [node]], *HEARD], [*DRIVER, ["/clock", ["/rviz"]], *subscribed], []),
            "getTopicTypes": [[topic, kind], ["/hero_3/odom", "nav_msgs/Odometry"]],
        }
        ask = create_autospec(ask_master, side_effect=answers.__getitem__)
        monkeypatch.setattr(lost_commands, "ask_master", ask)
        return lost_commands.find_lost_commands()

    return find


def test_a_topic_that_no_robot_reads_is_named_with_the_one_that_is_meant(find):
    (text,) = find("/hero_3/velocity_controler/cmd_vel", TWIST)
    assert text.startswith("/mine publishes /hero_3/velocity_controler/cmd_vel, which no robot reads")
    assert text.endswith("did you mean /hero_3/velocity_controller/cmd_vel?")
    assert find("/cmd_vel", TWIST)[0].endswith("did you mean /hero_N/velocity_controller/cmd_vel?")
    assert find("/hero_3/LED", "std_msgs/ColorRGBA")[0].endswith("did you mean /hero_3/led?")


def test_an_absent_robot_and_goals_that_no_program_takes_are_named(find):
    assert "no driver has hero_9" in find("/hero_9/velocity_controller/cmd_vel", TWIST)[0]
    assert "no program takes its goals" in find("/hero_3/goal", "geometry_msgs/PoseStamped")[0]


def test_a_type_that_robots_do_not_take_is_named_with_theirs(find):
    (text,) = find("/hero_3/cmd_vel", "std_msgs/String")
    assert text == "/mine publishes /hero_3/cmd_vel as std_msgs/String, but robots take geometry_msgs/Twist"


def test_what_is_heard_or_no_command_is_no_fault(find):
    assert find("/hero_3/cmd_vel", TWIST) == []
    assert find("/turtle/cmd_vel", TWIST, subscribed=[["/turtle/cmd_vel", ["/turtle"]]]) == []
    assert find("/hero_3/arm", TWIST, node="/hero_driver") == [], "a topic that the robot declares"
    assert find("/hero_3/measured_pose", "geometry_msgs/PoseStamped") == []


def test_topics_that_the_asking_node_keeps_open_are_no_fault(find):
    assert find("/hero_9/velocity_controller/cmd_vel", TWIST, node="/asking") == []
