"""Types that robots name: found with their md5, carried as bytes, refused in words that help."""

import io
import struct
import sys
import types

import pytest
import rospy.msg
from vectors import ANSWER_MD5, EMPTY_MD5, MOTOR_MD5, SET_PID_MD5, STOCK_TOPICS, TWIST_MD5

from hero_driver.ros.message_types import (
    MessageTypeError,
    RawMessage,
    apply_aliases,
    find_message_class,
    find_service_class,
    make_raw_class,
    make_raw_service,
)

STOCK_MESSAGES = [topic[3:] for topic in STOCK_TOPICS if topic[0] in (0, 1)]

# type, md5 of the request, of the answer, of the service as a whole
STOCK_SERVICES = [
    (
        "hero_common/SetIRCalibration",
        "27748d949ad62e65750ad22074426005",
        ANSWER_MD5,
        "fc55fd34ad2ef676815ba2e14521ac73",
    ),
    ("hero_common/SetOdom", "938fa65709584ad8e77d238529be13b8", ANSWER_MD5, "4ed90569b1afd039b963e42a12637d2b"),
    ("hero_common/SetMotor", MOTOR_MD5, ANSWER_MD5, "07e32bced0fc14456815cdd097819b89"),
    ("hero_common/SetPID", SET_PID_MD5, ANSWER_MD5, "69c16eccc66fd6b477afb5e5500b4b47"),
    ("std_srvs/Trigger", EMPTY_MD5, ANSWER_MD5, "937c9679a518e3a18d831e57125ea522"),
]


@pytest.mark.parametrize(
    "type_name, ros_type",
    [
        ("hero_common/Encoder", "hero_msgs/Encoder"),
        ("tf/tfMessage", "tf2_msgs/TFMessage"),
        ("nav_msgs/Odometry", "nav_msgs/Odometry"),
        ("tf/Other", "tf/Other"),
        ("hero_commons/Encoder", "hero_commons/Encoder"),
    ],
)
def test_names_of_old_packages_stand_for_those_that_are_here(type_name, ros_type):
    assert apply_aliases(type_name) == ros_type


# Messages.


@pytest.mark.parametrize("type_name, md5sum", sorted(set(STOCK_MESSAGES)))
def test_every_message_type_of_the_stock_robot_is_found_with_its_md5(type_name, md5sum):
    message_class = find_message_class(type_name, md5sum)
    assert message_class._type == apply_aliases(type_name)
    assert message_class._md5sum == md5sum


def test_another_md5_is_refused_with_both_and_the_remedy():
    with pytest.raises(MessageTypeError) as caught:
        find_message_class("hero_common/Encoder", "0" * 32)
    text = str(caught.value)
    assert "hero_common/Encoder has md5 " + "0" * 32 in text
    assert "hero_msgs/Encoder has b5586cdbae9b740afc6a1f403a2d7dde" in text
    assert text.endswith(
        "build the version of package hero_msgs that fits the robot's firmware and source its workspace"
    )
    assert "\n" not in text


@pytest.mark.parametrize("type_name", ["no_such_msgs/Thing", "std_msgs/NoSuchThing", "hero_driver/Thing", "bare/Thing"])
def test_an_unknown_type_is_refused_with_the_package_to_install(type_name, monkeypatch):
    monkeypatch.setitem(sys.modules, "bare", types.ModuleType("bare"))  # no package, and without __spec__
    with pytest.raises(MessageTypeError) as caught:
        find_message_class(type_name, TWIST_MD5)
    assert type_name in str(caught.value)
    assert "package " + type_name.split("/")[0] in str(caught.value)


def test_a_robot_cannot_make_the_driver_import_any_other_module(tmp_path, monkeypatch):
    (tmp_path / "module_of_somebody_else.py").write_text("raise SystemExit('imported')\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(MessageTypeError):
        find_message_class("module_of_somebody_else/Thing", TWIST_MD5)
    with pytest.raises(MessageTypeError):
        find_service_class("module_of_somebody_else/Thing", TWIST_MD5, TWIST_MD5)


@pytest.mark.parametrize("type_name", ["rospy/AnyMsg", "rospy/struct", "rospy/deserialize_messages"])
def test_what_has_the_name_of_a_type_and_is_none_is_refused(type_name):
    with pytest.raises(MessageTypeError):
        find_message_class(type_name, TWIST_MD5)


# Bytes instead of fields.


def test_a_raw_class_looks_like_its_type_from_outside():
    twist = find_message_class("geometry_msgs/Twist", TWIST_MD5)
    raw_class = make_raw_class(twist)
    assert issubclass(raw_class, RawMessage)
    assert raw_class.__name__ == "RawTwist"
    assert (raw_class._type, raw_class._md5sum) == ("geometry_msgs/Twist", TWIST_MD5)
    assert raw_class._full_text == twist._full_text


def test_there_is_one_raw_class_for_each_type():
    twist = find_message_class("geometry_msgs/Twist", TWIST_MD5)
    encoder = find_message_class("hero_common/Encoder", "b5586cdbae9b740afc6a1f403a2d7dde")
    assert make_raw_class(twist) is make_raw_class(twist)
    assert make_raw_class(twist) is not make_raw_class(encoder)
    assert make_raw_class(encoder)._type == "hero_msgs/Encoder"


def test_bytes_pass_through_unread():
    raw_class = make_raw_class(find_message_class("geometry_msgs/Twist", TWIST_MD5))
    for data in (b"", b"\x00\xff", bytes(48)):
        buffer = io.BytesIO()
        raw_class(data).serialize(buffer)
        assert buffer.getvalue() == data
        assert raw_class().deserialize(data).data == data
        assert type(raw_class().deserialize(data)) is raw_class


def test_the_bytes_of_a_message_are_those_that_ros_writes_and_reads():
    twist_class = find_message_class("geometry_msgs/Twist", TWIST_MD5)
    data = struct.pack("<6d", 0.1, 0.0, 0.0, 0.0, 0.0, -1.0)
    twist = twist_class().deserialize(make_raw_class(twist_class)().deserialize(data).data)
    assert (twist.linear.x, twist.angular.z) == (0.1, -1.0)
    buffer = io.BytesIO()
    twist.serialize(buffer)
    assert buffer.getvalue() == data


def test_rospy_does_not_count_sequence_numbers_into_raw_messages():
    raw_class = make_raw_class(find_message_class("nav_msgs/Odometry", "cd5e73d190d741a2f92e81eda573aca7"))
    assert raw_class._has_header is False
    buffer = io.BytesIO()
    rospy.msg.serialize_message(buffer, 5, raw_class(b"\x07\x00\x00\x00rest"))
    assert buffer.getvalue() == b"\x08\x00\x00\x00\x07\x00\x00\x00rest"


# Services.


@pytest.mark.parametrize("type_name, request_md5sum, answer_md5sum, service_md5sum", STOCK_SERVICES)
def test_every_service_type_of_the_stock_robot_is_found_with_its_md5s(
    type_name, request_md5sum, answer_md5sum, service_md5sum
):
    service_class = find_service_class(type_name, request_md5sum, answer_md5sum)
    raw_class = make_raw_service(service_class)
    assert (raw_class._type, raw_class._md5sum) == (apply_aliases(type_name), service_md5sum)
    assert raw_class._request_class._md5sum == request_md5sum
    assert raw_class._response_class._md5sum == answer_md5sum
    assert issubclass(raw_class._request_class, RawMessage)
    assert make_raw_service(service_class) is raw_class


def test_services_with_the_same_halves_stay_different_types():
    pid = make_raw_service(find_service_class(*STOCK_SERVICES[3][:3]))
    trigger = make_raw_service(find_service_class(*STOCK_SERVICES[4][:3]))
    assert pid._response_class._md5sum == trigger._response_class._md5sum
    assert pid._response_class is not trigger._response_class


@pytest.mark.parametrize(
    "request_md5sum, answer_md5sum, half",
    [("0" * 32, ANSWER_MD5, "request"), ("938fa65709584ad8e77d238529be13b8", "0" * 32, "answer")],
)
def test_a_half_with_another_md5_is_refused_and_named(request_md5sum, answer_md5sum, half):
    with pytest.raises(MessageTypeError, match="%s of service type hero_common/SetOdom has md5 0{32}" % half):
        find_service_class("hero_common/SetOdom", request_md5sum, answer_md5sum)


def test_an_unknown_service_type_is_refused():
    with pytest.raises(MessageTypeError, match="no_such_srvs/Thing is not known here"):
        find_service_class("no_such_srvs/Thing", EMPTY_MD5, EMPTY_MD5)
    with pytest.raises(MessageTypeError, match="geometry_msgs/Twist is not known here"):
        find_service_class("geometry_msgs/Twist", EMPTY_MD5, EMPTY_MD5)
