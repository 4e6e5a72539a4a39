"""The fleet as rows: their order, and which expected robot did not join or move."""

import pytest

from hero_client.ros import RobotTrack
from hero_msgs.msg import Robot
from hero_node import Pose
from hero_tools import fleet
from hero_tools.fleet_rows import RobotRow, find_missing, sort_rows

ORIGIN = Pose(0.0, 0.0, 0.0)


def make_row(robot_id, nearest=None, pose=ORIGIN, distance_m=1.0, turned_rad=0.0, **reported):
    """Return the row of a robot that is ready and has moved; reported: other fields of hero_msgs/Robot."""
    robot = Robot(
        id=robot_id,
        namespace="/hero_%d" % robot_id,
        address="10.42.0.%d:4000" % (robot_id + 10),
        state=Robot.READY,
        bytes_per_s=44051.0,
        firmware="v3.8",
    )
    for name, value in reported.items():
        setattr(robot, name, value)
    track = RobotTrack()
    track.pose, track.nearest, track.proximity_seen, track.is_free = pose, nearest, True, nearest is None
    track.distance_m, track.turned_rad = distance_m, turned_rad
    return RobotRow(robot, track, odom_hz=29.3)


def test_no_robot_is_missing_if_all_joined_and_moved():
    assert find_missing([make_row(0), make_row(1)], range(2)) == {}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"id": 7, "namespace": "/hero_7"}, "did not join"),
        ({"state": Robot.REFUSED, "last_error": "second hero_0"}, "REFUSED: second hero_0"),
        ({"pose": None}, "no odometry"),
        ({"distance_m": 0.01}, "did not move"),
    ],
)
def test_a_robot_that_did_not_join_or_move_is_named_with_the_reason(changes, words):
    missing = find_missing([make_row(0, **changes), make_row(1)], range(2))
    assert list(missing) == [0]
    assert words in missing[0]


def test_rows_are_sorted_by_id_those_without_one_last():
    nameless = make_row(-1, namespace="", address="10.42.0.9:4000")
    rows = sort_rows([make_row(10), nameless, make_row(3, state=Robot.AWAY), make_row(2)])
    assert [row.robot.id for row in rows] == [2, 3, 10, -1]


def test_each_option_of_fleet_is_taken_and_none_is_needed():
    plain = vars(fleet.parse_options([]))
    assert plain == {
        "once": False,
        "json": False,
        "seconds": None,
        "expect": None,
        "inventory": None,
        "calibrations": "~/hero_calibration",
    }
    for words, changed in (
        (["--once"], {"once": True}),
        (["--json"], {"json": True}),
        (["--seconds", "2.5"], {"seconds": 2.5}),
        (["--expect", "3"], {"expect": 3}),
        (["--inventory"], {"inventory": "table", "once": True}),
        (["--inventory", "csv"], {"inventory": "csv", "once": True}),
        (["--calibrations", "/lab"], {"calibrations": "/lab"}),
    ):
        assert vars(fleet.parse_options(words)) == {**plain, **changed}


@pytest.mark.parametrize(
    "option", ["--seconds=-1", "--seconds=inf", "--seconds=nan", "--expect=2000000", "--expect=many", "--color"]
)
def test_wrong_options_of_fleet_are_refused_by_name(option, capsys):
    with pytest.raises(SystemExit) as caught:
        fleet.parse_options([option])
    assert caught.value.code == 2
    assert option.partition("=")[0] in capsys.readouterr().err.splitlines()[-1]
