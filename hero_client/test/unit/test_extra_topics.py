"""Topics that fleet.yaml declares: their types and fields are checked at the start, their values read by name."""

import math
from types import SimpleNamespace

import pytest

pytest.importorskip("rospy", reason="topics are ROS's")
from std_msgs.msg import Float32

from hero_client.ros import extra_topics, ros_link
from hero_client.ros.extra_topics import load_fleet_file
from hero_client.ros.ros_link import RosLink
from hero_node import HeroError
from hero_node.files import ExtraTopic

BATTERY = "{name: battery, topic: power, type: std_msgs/Float32, field: data, unit: V}"


@pytest.fixture(name="write")
def make_file(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_HOME", str(tmp_path))

    def write(topic):
        (tmp_path / "fleet.yaml").write_text("topics: [%s]" % topic)
        load_fleet_file.cache_clear()

    yield write
    load_fleet_file.cache_clear()


def test_a_declared_topic_has_a_class_and_a_field(write):
    write(BATTERY)
    (topic,) = load_fleet_file().topics
    assert extra_topics.find_class(topic) is Float32
    assert extra_topics.read_field(Float32(3.5), topic) == 3.5


@pytest.mark.parametrize(
    ("wrong", "right", "words"),
    [
        ("std_msgs/Flaot32", "std_msgs/Float32", "the type std_msgs/Flaot32 is not installed"),
        ("field: volts", "field: data", "std_msgs/Float32 has no field volts"),
        ("nmae: battery", "name: battery", "nmae"),
    ],
)
def test_a_wrong_declaration_ends_a_program_with_one_line(write, wrong, right, words):
    write(BATTERY.replace(right, wrong))
    with pytest.raises(HeroError, match=words):
        load_fleet_file()


def test_a_value_is_read_by_its_name_and_the_first_one_waited_for():
    class Link:
        _extras = {"battery": ExtraTopic("battery", "power", "std_msgs/Float32", "data", "V")}
        noted, age = [], math.inf
        subscribe = noted.append

        def age_s(self, topic):
            return self.age

        def wait_for_next(self, topic, timeout_s):
            self.noted.append(timeout_s)

        def read(self, topic):
            return SimpleNamespace(data=3.5)

    link = Link()
    assert RosLink.read_extra(link, "battery", 5.0) == 3.5 and link.noted == ["power", 5.0]
    link.age = 60.0
    assert RosLink.read_extra(link, "battery", 5.0) == 3.5 and link.noted[2:] == ["power"], "slow topics stay valid"
    with pytest.raises(ValueError, match="'volts' is not declared in .*fleet.yaml, which names battery"):
        RosLink.read_extra(link, "volts", 5.0)
    assert ros_link.MESSAGE_CLASSES.keys() >= {"odom"}
