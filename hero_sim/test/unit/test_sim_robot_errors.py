import numpy as np
import pytest
from driver_side import parse_options

from hero_sim.errors import OptionError
from hero_sim.population import build_errors, place_worlds
from hero_sim.world.arena import build_default
from hero_sim.world.robot_errors import describe_errors
from hero_test.nonempty import nonempty


def build(*arguments):
    return build_errors(parse_options(*arguments))


def test_the_same_seed_draws_the_same_robots_and_another_seed_others():
    first, again, other = build("--count", "3"), build("--count", "3"), build("--count", "3", "--seed", "1")
    assert all((left == right).all() for left, right in nonempty(zip(first, again)))
    assert (first.wheel_scale != other.wheel_scale).all()


def test_perfect_robots_are_all_alike():
    errors = build("--count", "5", "--perfect")
    assert all((np.ptp(array, axis=0) == 0).all() for array in errors)
    assert (errors.servo_center_us == 1500).all() and (errors.slip == 0).all()


def test_a_known_error_of_one_robot_leaves_the_others_as_drawn():
    drawn = build("--count", "3", "--first-id", "5")
    known = build("--count", "3", "--first-id", "5", "--error", "robot=6,left_center_us=1533", "--error", "slip=0.01")
    assert known.servo_center_us[1].tolist() == [1533, drawn.servo_center_us[1, 1]]
    assert (known.servo_center_us[[0, 2]] == drawn.servo_center_us[[0, 2]]).all()
    assert known.slip.tolist() == [[0.01]] * 3


def test_one_sensor_can_differ_from_what_is_said_of_all():
    errors = build("--error", "alpha3_counts_m2=0.39,alpha_counts_m2=0.44")
    assert errors.alpha_counts_m2[0].tolist() == [0.44, 0.44, 0.44, 0.39, 0.44, 0.44, 0.44, 0.44]


def test_what_is_printed_can_be_set_again():
    errors = build("--count", "3", "--first-id", "2")
    arguments = ["--error=" + line for line in describe_errors(errors, 2)]
    again = build("--count", "3", "--first-id", "2", "--seed", "9", *arguments)
    assert all(np.allclose(left, right, rtol=1e-5) for left, right in nonempty(zip(errors, again)))


def test_of_a_file_the_lines_of_all_robots_and_of_these_are_taken(tmp_path):
    file = tmp_path / "errors.txt"
    file.write_text("# fitted\n\nslip=0.01\n  robot=6,slip=0.03  \nrobot=9,slip=0.04\nslip=0.05,robot=7\n")
    errors = build("--count", "3", "--first-id", "5", "--errors", str(file), "--error", "robot=7,lag_s=0.1")
    assert errors.slip.ravel().tolist() == [0.01, 0.03, 0.05] and errors.servo_lag_s.ravel().tolist() == [
        0.08,
        0.08,
        0.1,
    ]
    file.write_bytes(b"\xff")
    with pytest.raises(OptionError, match="errors .* cannot be read: 'utf-8' codec can't decode"):
        build("--errors", str(file))


@pytest.mark.parametrize(
    "text, named",
    [
        ("slip", "'slip' is not KEY=VALUE"),
        ("slop=1", "unknown key 'slop'; known are robot, left_center_us"),
        ("slip=much", "must be a number, not 'much'"),
        ("slip=0.9", "slip must be 0..0.5, not 0.9"),
        ("slip=nan", "slip must be 0..0.5, not nan"),
        ("slip=0.1,robot=3", "robot must be 0..0, not 3"),
        ("slip=0.1,robot=me", "robot must be a number, not 'me'"),
    ],
)
def test_a_wrong_error_is_named(text, named):
    with pytest.raises(OptionError) as caught:
        build("--error", text)
    assert named in str(caught.value) and text in str(caught.value)


def test_known_errors_hold_in_each_of_many_worlds_for_the_robot_named():
    arena, poses = build_default(2), np.zeros((3, 2, 3))
    poses[:, 1, 0], poses[:, :, 1] = 0.3, np.arange(3)[:, None] * 0.01
    world = place_worlds(arena, poses, (5, 6, 7), 1.0, known=["slip=0.1,robot=1"])
    assert world.errors.slip.ravel().tolist() == [0.02, 0.1] * 3
    assert world.worlds == 3 and world.poses[4].tolist() == poses[2, 0].tolist()
    for index, seed in enumerate((5, 6, 7)):
        alone = place_worlds(arena, poses[index : index + 1], (seed,), 1.0)
        assert world.errors.wheel_scale[2 * index : 2 * index + 2].tolist() == alone.errors.wheel_scale.tolist()
    assert len(set(world.errors.wheel_scale.ravel().tolist())) == 12
