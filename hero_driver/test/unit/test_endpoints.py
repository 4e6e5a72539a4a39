"""What a robot has registered goes when it leaves, also if the ROS master refuses some of it."""

from unittest import mock

import pytest
import rospy

from hero_driver.ros import endpoints as module
from hero_driver.ros.endpoints import QUEUE_LENGTH, Endpoints, Layout
from hero_driver.ros.raw_publisher import RawPublisher
from hero_driver.ros.raw_subscriber import RawSubscriber
from hero_node.ros_messages import MD5SUMS

COLOR = Layout("std_msgs/ColorRGBA", ("a29a96539573343b1310c73607334b00",))
NUMBER = Layout("std_msgs/Float32", (MD5SUMS["std_msgs/Float32"],))
WRONG = COLOR._replace(md5sums=("0" * 32,))
LIGHT = "/hero_7/led"


def test_one_that_cannot_be_unregistered_keeps_no_other():
    lines, released = [], mock.Mock()
    publishers = [mock.create_autospec(RawPublisher, instance=True) for _ in range(2)]
    publishers[0].release.return_value = [mock.Mock(side_effect=ConnectionRefusedError("no master"))]
    publishers[1].release.return_value = [mock.Mock()]
    Endpoints("hero_7", lambda *line: lines.append(line)).close([released], publishers)
    released.assert_called_once_with()
    publishers[1].release.return_value[0].assert_called_once_with()
    ((level, _, text),) = lines
    assert level == "error" and text.endswith("could not be unregistered: ConnectionRefusedError: no master")


def test_what_was_taken_down_is_not_taken_down_again():
    endpoints, close = Endpoints("hero_7", mock.Mock()), mock.Mock()
    endpoints._open["topic", "/hero_7/led"] = (
        Layout("std_msgs/ColorRGBA", ("a29a96539573343b1310c73607334b00",)),
        close,
    )
    for _ in range(2):
        endpoints.close([], [])
    close.assert_called_once_with()


@pytest.fixture(name="bench")
def make_bench():
    """Endpoints whose lines and subscribers, by the types that they were made for, a test sees."""
    bench = mock.Mock(spec_set=["endpoints", "lines", "made", "make"])
    bench.lines, bench.made = [], {}
    bench.endpoints = Endpoints("hero_7", lambda *line: bench.lines.append(line))

    def make(ros_type):
        bench.made[ros_type] = mock.create_autospec(RawSubscriber, instance=True)
        return bench.made[ros_type]

    bench.make = make
    return bench


def test_a_topic_is_subscribed_to_once_and_anew_with_another_type(bench):
    for _ in range(2):
        assert bench.endpoints.subscribe(LIGHT, COLOR, bench.make)
    color = bench.made["std_msgs/ColorRGBA"]
    ((name, raw_class, queue_length),) = [one.args for one in color.open.call_args_list]
    assert (name, raw_class._type, queue_length) == (LIGHT, "std_msgs/ColorRGBA", QUEUE_LENGTH)
    assert bench.endpoints.subscribe(LIGHT, NUMBER, bench.make)
    color.close.assert_called_once_with()
    assert bench.made["std_msgs/Float32"].open.called
    for _ in range(2):
        bench.endpoints.unsubscribe(LIGHT)
    bench.made["std_msgs/Float32"].close.assert_called_once_with()
    assert bench.endpoints.subscribe(LIGHT, NUMBER, bench.make) and bench.made["std_msgs/Float32"].open.called


def test_a_layout_that_is_not_known_here_is_told_of_until_it_is_another(bench):
    assert not bench.endpoints.subscribe(LIGHT, WRONG, bench.make)
    assert not bench.endpoints.subscribe(LIGHT, WRONG, bench.make) and not bench.made
    ((level, _, text),) = bench.lines
    assert level == "error" and text.startswith(f"hero_7: topic {LIGHT} refused: ")
    assert f"hero_7: {bench.endpoints.last_error}" == text
    bench.endpoints.report_error("/hero_7/odom", "another problem")
    assert bench.endpoints.last_error == "another problem"
    assert bench.endpoints.subscribe(LIGHT, COLOR, bench.make), "the robot was flashed anew"
    assert bench.endpoints.last_error == "another problem"
    bench.endpoints.report_error("/hero_7/odom", "a third one")
    assert bench.endpoints.last_error == "a third one" and len(bench.lines) == 3


def test_what_was_subscribed_to_goes_when_its_new_layout_cannot_be_used(bench):
    bench.endpoints.subscribe(LIGHT, COLOR, bench.make)
    assert not bench.endpoints.subscribe(LIGHT, WRONG, bench.make)
    bench.made["std_msgs/ColorRGBA"].close.assert_called_once_with()


def make_publisher(is_open=False):
    publisher = mock.create_autospec(RawPublisher, instance=True)
    publisher.is_open = is_open
    publisher.release.return_value = [mock.Mock(), mock.Mock()]
    return publisher


def test_all_topics_that_a_message_becomes_are_advertised_each_once(bench):
    old, known, derived, wrong = make_publisher(), make_publisher(True), make_publisher(), make_publisher()
    outputs = [
        ("/hero_7/distance", "std_msgs/Float32", known),
        ("/hero_7/no", "no_msgs/No", wrong),
        ("/hero_7/range", "sensor_msgs/Range", derived),
    ]
    with mock.patch.dict(MD5SUMS, {"no_msgs/No": "0" * 32}):
        bench.endpoints.advertise("/hero_7/distance", NUMBER, outputs, [old])
    assert [release.call_count for release in old.release.return_value] == [1, 1]
    assert not known.open.called and not wrong.open.called
    ((name, raw_class),) = [one.args for one in derived.open.call_args_list]
    assert (name, raw_class._type) == ("/hero_7/range", "sensor_msgs/Range")


def test_a_topic_without_a_layout_is_not_advertised_and_its_old_one_goes(bench):
    old, publisher = make_publisher(), make_publisher()
    bench.endpoints.advertise(LIGHT, WRONG, [(LIGHT, "std_msgs/ColorRGBA", publisher)], [old])
    bench.endpoints.advertise(LIGHT, COLOR, [], [])
    assert old.release.return_value[0].called and not publisher.open.called and len(bench.lines) == 1


def test_a_service_answers_by_bytes_and_goes_with_the_robot(bench, monkeypatch):
    service = mock.create_autospec(rospy.Service)
    monkeypatch.setattr(module.rospy, "Service", service)
    layout = Layout("std_srvs/SetBool", ("8b94c1b53db61fb6aed406028ad6332a", "937c9679a518e3a18d831e57125ea522"))
    for _ in range(2):
        assert bench.endpoints.serve("/hero_7/enable", layout, lambda request: b"answer to " + request)
    ((name, raw_class, answer),) = [one.args for one in service.call_args_list]
    assert name == "/hero_7/enable" and answer(raw_class._request_class(b"a request")).data == b"answer to a request"
    assert not bench.endpoints.serve("/hero_7/enable", layout._replace(md5sums=("0" * 32,) * 2), bytes)
    assert service.return_value.shutdown.call_count == 1, "it was declared with another type"
    bench.endpoints.serve("/hero_7/enable", layout, bytes)
    bench.endpoints.close([], [])
    assert service.return_value.shutdown.call_count == 2


def test_nothing_is_registered_for_a_robot_that_has_left(bench):
    bench.endpoints.end()
    publisher = make_publisher()
    assert not bench.endpoints.subscribe(LIGHT, COLOR, bench.make) and not bench.made
    bench.endpoints.advertise(LIGHT, COLOR, [(LIGHT, "std_msgs/ColorRGBA", publisher)], [])
    assert not publisher.open.called and bench.lines == []
