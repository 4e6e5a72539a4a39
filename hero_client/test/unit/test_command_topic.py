"""Commands before the driver has subscribed: the newest one waits, a stop takes its place, and no call blocks."""

from types import SimpleNamespace

import pytest

pytest.importorskip("rospy", reason="topics are rospy's")
from hero_client.ros import robot_topics
from hero_client.ros.robot_topics import CONNECT_S, CommandTopic, NewestMessages
from hero_client.ros.ros_link import NEEDED


@pytest.fixture(name="ros")
def make_ros(monkeypatch):
    """The clock, the timers and the publisher that a CommandTopic uses."""
    ros = SimpleNamespace(now_s=100.0, sent=[], warned=[], timers=[], daemons=[], subscribers=0)
    publisher = SimpleNamespace(publish=ros.sent.append, get_num_connections=lambda: ros.subscribers)

    def make_timer(after_s, call):
        ros.timers.append(call)
        timer = SimpleNamespace()
        timer.start = lambda: ros.daemons.append(timer.daemon)
        return timer

    monkeypatch.setattr(robot_topics.rospy, "Publisher", lambda *arguments, **options: publisher)
    monkeypatch.setattr(robot_topics.rospy, "is_shutdown", lambda: False)
    monkeypatch.setattr(robot_topics.rospy, "logwarn", lambda text, *values: ros.warned.append(text % values))
    monkeypatch.setattr(robot_topics.threading, "Timer", make_timer)
    monkeypatch.setattr(robot_topics.time, "monotonic", lambda: ros.now_s)
    monkeypatch.setattr(robot_topics.time, "sleep", lambda duration_s: pytest.fail("waits"))
    ros.topic = CommandTopic("/hero_0/cmd_vel", object, lambda: "no driver answers")
    return ros


def subscribe(ros):
    ros.subscribers = 1
    ros.topic.peer_subscribe("/hero_0/cmd_vel", None, None)


def test_the_newest_early_command_is_sent_with_the_subscription(ros):
    ros.topic.publish("slow")
    ros.topic.publish("fast")
    assert ros.sent == [] and ros.daemons == [True], "it keeps no program from ending"
    subscribe(ros)
    assert ros.sent == ["fast"]
    ros.topic.publish("next")
    ros.timers[0]()
    assert ros.sent == ["fast", "next"] and ros.warned == []


def test_a_command_that_waited_goes_to_the_first_subscriber_only(ros):
    ros.topic.publish("fast")
    for _ in range(2):  # the driver, and later rostopic echo
        subscribe(ros)
    assert ros.sent == ["fast"], "a second subscriber starts no robot"


def test_a_stop_takes_the_place_of_an_early_command(ros):
    ros.topic.publish("fast")
    for _ in range(2):
        ros.topic.publish("stop", is_stop=True)
    assert ros.sent == [] and len(ros.warned) == 1
    subscribe(ros)
    assert ros.sent == ["stop"] and len(ros.warned) == 1


def test_an_early_stop_waits_and_is_not_warned_about(ros):
    ros.topic.publish("stop", is_stop=True)
    assert ros.sent == []
    subscribe(ros)
    assert ros.sent == ["stop"]
    ros.subscribers = 0
    ros.now_s += CONNECT_S + 0.1
    ros.topic.publish("stop", is_stop=True)
    assert ros.sent == ["stop"] * 2 and ros.warned == []  # rospy drops it without a subscriber


def test_a_command_that_follows_an_early_stop_is_warned_about_in_time(ros):
    ros.topic.publish("stop", is_stop=True)
    ros.topic.publish("fast")
    ros.now_s += CONNECT_S
    ros.timers[0]()
    assert ros.sent == [] and len(ros.warned) == 1


def test_a_command_without_subscribers_is_warned_about_once(ros):
    ros.topic.publish("fast")
    ros.now_s += CONNECT_S
    ros.timers[0]()
    ros.topic.publish("fast")
    assert ros.warned == ["a command is lost: nothing subscribes to /hero_0/cmd_vel: no driver answers"]
    subscribe(ros)
    assert "fast" not in ros.sent[1:]


def test_a_command_long_after_the_start_is_lost_and_said_anew_later(ros):
    ros.now_s += CONNECT_S + 0.1
    for _ in range(2):
        ros.topic.publish("fast")
    assert ros.timers == [] and len(ros.warned) == 1 and ros.sent == ["fast"] * 2  # which rospy drops
    ros.subscribers = 1
    ros.topic.publish("fast")
    ros.subscribers = 0
    ros.topic.publish("fast")
    assert len(ros.warned) == 2


def test_a_robot_without_the_imu_that_was_asked_for_is_ready(monkeypatch):
    monkeypatch.setattr(robot_topics.rospy, "Subscriber", lambda *arguments, **options: None)
    messages = NewestMessages("/hero_0", {"imu": object, "odom": object})
    messages.subscribe("imu")
    assert messages.find_silent(NEEDED, 1.0) is None
    messages.subscribe("odom")
    assert messages.find_silent(NEEDED, 1.0) == "odom"
