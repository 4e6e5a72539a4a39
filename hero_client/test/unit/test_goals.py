"""Any goal message: taken or refused with a reason, and no command that a robot cannot take."""

import math
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hero_client.controllers.go_to_goal import Goal, GoToGoalController
from hero_client.controllers.motion import SILENT_STEPS, State
from hero_node import STOP, Pose
from hero_node.parameters import MAX_COORDINATE_M

pytest.importorskip("actionlib", reason="the server of goals is a node's")
from hero_client.apps.go_to_goal_server import MAX_FRAME_LENGTH, InvalidGoalError, read_goal

INF, NAN = math.inf, math.nan

numbers = st.one_of(st.floats(), st.floats(-2.0, 2.0), st.sampled_from((0.0, -0.0, NAN, INF, -INF, 1e200, 5e-324)))
good = st.floats(-MAX_COORDINATE_M, MAX_COORDINATE_M)
poses = st.builds(Pose, good, good, st.floats(-1e4, 1e4))
any_poses = st.one_of(poses, st.builds(Pose, numbers, numbers, numbers), st.none())
eight = st.lists(st.sampled_from((NAN, INF, 0.0, 0.05, 0.2)), min_size=8, max_size=8)
ranges = st.one_of(st.none(), st.just([]), eight)
often = settings(max_examples=300)


def make_message(place=(0.1, 0.2, 0.0), turn=(0.0, 0.0, 0.0, 1.0), frame="world"):
    position = SimpleNamespace(**dict(zip("xyz", place)))
    orientation = SimpleNamespace(**dict(zip("xyzw", turn)))
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=frame), pose=SimpleNamespace(position=position, orientation=orientation)
    )


messages = st.builds(
    make_message,
    st.tuples(numbers, numbers, numbers),
    st.tuples(numbers, numbers, numbers, numbers),
    st.text(max_size=2 * MAX_FRAME_LENGTH),
)


@often
@given(message=messages, use_heading=st.booleans())
def test_any_goal_message_is_accepted_or_rejected_in_one_line(message, use_heading):
    try:
        goal, frame = read_goal(message, use_heading)
    except InvalidGoalError as error:
        assert str(error) and str(error).isprintable()
    else:
        assert all(math.isfinite(value) for value in goal if value is not None)
        assert use_heading or goal.yaw_rad is None
        assert frame == message.header.frame_id
        # What tf2 and a log line can take.
        assert frame.isprintable() and len(frame.encode()) < 5 * MAX_FRAME_LENGTH


@often
@given(
    avoid=st.booleans(),
    goal=st.builds(Goal, good, good, st.one_of(st.none(), st.floats(-math.pi, math.pi))),
    steps=st.lists(st.tuples(any_poses, ranges), min_size=1, max_size=5),
)
def test_any_accepted_goal_and_any_pose_give_finite_slow_commands(avoid, goal, steps):
    controller = GoToGoalController(goal, 0.0, avoid=avoid)
    for index, (pose, seen) in enumerate(steps):
        linear_m_s, angular_rad_s = controller.step(pose, seen, 0.1 * index)
        assert abs(linear_m_s) <= 0.3 and abs(angular_rad_s) <= 4.0, (linear_m_s, angular_rad_s)
        if pose is None or not all(math.isfinite(value) for value in pose):
            assert (linear_m_s, angular_rad_s) == STOP


@pytest.mark.parametrize(
    "wrong, words",
    [
        ({"place": (NAN, 0.0, 0.0)}, "must be finite"),
        ({"place": (0.0, -INF, 0.0)}, "must be finite"),
        ({"place": (1e300, 0.0, 0.0)}, "within"),
        ({"turn": (NAN, 0.0, 0.0, 0.0)}, "no quaternion"),
        ({"turn": (0.0, 0.0, INF, 1.0)}, "no quaternion"),
        ({"turn": (0.0, 1e200, 0.0, 1.0)}, "no quaternion"),
        ({"frame": "wor\x00ld"}, "frame_id"),
        ({"frame": "world\n[ERROR] forged"}, "frame_id"),
        ({"frame": "x" * 300}, f"frame_id must be up to 200 printable characters, not '{'x' * 40}'$"),
    ],
)
def test_an_invalid_goal_is_rejected_with_the_reason(wrong, words):
    with pytest.raises(InvalidGoalError, match=words):
        read_goal(make_message(**wrong), use_heading=True)


def test_a_goal_at_the_very_limits_is_taken():
    goal, frame = read_goal(make_message((1e6, -1e6, 0.0), (0.0, 0.0, 0.0, 1e3), "f" * 200), True)
    assert goal[:2] == (1e6, -1e6) and frame == "f" * 200
    assert read_goal(make_message(turn=(0.0, 0.0, 0.0, 1e-6)), True)[0].yaw_rad is None


def test_a_quaternion_of_zeros_means_no_heading():
    assert read_goal(make_message(turn=(0.0, 0.0, 0.0, 0.0), frame=""), True) == (Goal(0.1, 0.2, None), "")
    assert read_goal(make_message(turn=(0.0, 0.0, 1.0, 0.0)), True)[0].yaw_rad == pytest.approx(math.pi)
    assert read_goal(make_message(turn=(NAN, NAN, NAN, NAN)), False)[0].yaw_rad is None


def test_a_robot_whose_odometry_is_not_finite_fails_and_stops():
    controller = GoToGoalController(Goal(1.0, 0.0), 0.0)
    for pose in (Pose(NAN, 0.0, 0.0), Pose(0.0, 0.0, INF)) * (SILENT_STEPS // 2):
        assert controller.state is State.ACTIVE
        assert controller.step(pose, None, 0.1) == STOP
    assert controller.state is State.FAILED
