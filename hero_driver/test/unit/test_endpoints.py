"""What a robot has registered goes when it leaves, also if the ROS master refuses some of it."""

from unittest import mock

from hero_driver.ros.endpoints import Endpoints, Layout
from hero_driver.ros.raw_publisher import RawPublisher


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
