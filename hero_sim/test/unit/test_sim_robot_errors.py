import numpy as np
import pytest
from driver_side import parse_options

from hero_sim.build import build_errors
from hero_sim.errors import OptionError
from hero_sim.world.robot_errors import describe_errors


def build(*arguments):
    return build_errors(parse_options(*arguments))


def test_the_same_seed_draws_the_same_robots_and_another_seed_others():
    first, again, other = build("--count", "3"), build("--count", "3"), build("--count", "3", "--seed", "1")
    assert all((left == right).all() for left, right in zip(first, again))
    assert (first.wheel_scale != other.wheel_scale).all()


def test_perfect_robots_are_all_alike():
    errors = build("--count", "5", "--perfect")
    assert all((np.ptp(array, axis=0) == 0).all() for array in errors)
    assert (errors.servo_center_us == 1500).all() and (errors.slip == 0).all()


def test_a_known_error_of_one_robot_leaves_the_others_as_drawn():
    drawn = build("--count", "3", "--first-id", "5")
    known = build(
        "--count", "3", "--first-id", "5", "--error", "robot=6,left_center_us=1533", "--error", "slip=0.01"
    )
    assert known.servo_center_us[1].tolist() == [1533, drawn.servo_center_us[1, 1]]
    assert (known.servo_center_us[[0, 2]] == drawn.servo_center_us[[0, 2]]).all()
    assert known.slip.tolist() == [[0.01]] * 3


def test_one_sensor_can_differ_from_what_is_said_of_all():
    errors = build("--error", "alpha3_counts_m2=0.39,alpha_counts_m2=0.44")
    assert errors.alpha_counts_m2[0].tolist() == [0.44, 0.44, 0.44, 0.39, 0.44, 0.44, 0.44, 0.44]


def test_what_is_printed_can_be_read_again(tmp_path):
    errors = build("--count", "3", "--first-id", "2")
    path = tmp_path / "errors.yaml"
    path.write_text("\n".join(describe_errors(errors, 2)))
    again = build("--count", "3", "--first-id", "2", "--seed", "9", "--errors", str(path))
    assert all(np.allclose(left, right, rtol=1e-5) for left, right in zip(errors, again))


def test_in_a_file_robots_come_over_all_and_the_command_line_over_the_file(tmp_path):
    path = tmp_path / "errors.yaml"
    path.write_text("hero_1: {slip: 0.03}\nall: {slip: 0.01, lag_s: 0.2}\n")
    errors = build("--count", "2", "--errors", str(path), "--error", "robot=0,slip=0")
    assert errors.slip.ravel().tolist() == [0.0, 0.03]
    assert errors.servo_lag_s.ravel().tolist() == [0.2, 0.2]


@pytest.mark.parametrize(
    "text, named",
    [
        ("slip", "'slip' is not KEY=VALUE"),
        ("slop=1", "unknown key 'slop'"),
        ("slip=much", "must be a number, not 'much'"),
        ("slip=0.9", "slip 0.9 is not in 0..0.5"),
        ("slip=nan", "slip nan is not in"),
        ("slip=0.1,robot=3", "robot 3 is not simulated here (0 to 0)"),
        ("slip=0.1,robot=me", "robot 'me' is not a number"),
    ],
)
def test_a_wrong_error_is_named(text, named):
    with pytest.raises(OptionError) as caught:
        build("--error", text)
    assert named in str(caught.value) and text in str(caught.value)


@pytest.mark.parametrize(
    "content, reason",
    [
        ("", ":1: must map all, hero_0"),
        ("hero_0:\n  slip: 1\n", ":2: slip 1 is not in 0..0.5"),
        ("hero_0:\n\n  slop: 1\n", ":3: unknown key 'slop'"),
        ("\nhero_7: {slip: 0}\n", ":2: robot 7 is not simulated here"),
        ("hero_0: 3\n", ":1: hero_0 must be a mapping"),
        ("hero_0:\n  slip: [1]\n", ":2: slip must be a number"),
        ("all: {slip: 0\n", "file.yaml:2:"),
    ],
)
def test_a_wrong_file_gets_line_and_reason(tmp_path, content, reason):
    path = tmp_path / "file.yaml"
    path.write_text(content)
    with pytest.raises(OptionError) as caught:
        build("--errors", str(path))
    assert reason in str(caught.value) and str(path) in str(caught.value)


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(OptionError, match=r"--errors /nowhere\.yaml cannot be read"):
        build("--errors", "/nowhere.yaml")
