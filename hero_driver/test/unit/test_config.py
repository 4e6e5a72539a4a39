"""Private parameters: defaults, what is allowed, and one clear line for everything else."""

import dataclasses
import ipaddress
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hero_driver.config import PARAMETERS, DriverConfig, read_config
from hero_driver.corrections.tick_odometry import WheelGeometry
from hero_node import ProgramError
from hero_test.nonempty import nonempty

NUMBERS = [name for name, parameter in PARAMETERS.items() if parameter.limits]
CHOICES = [name for name, parameter in PARAMETERS.items() if parameter.choices]
DIAGONALS = ["pose_covariance", "twist_covariance"]


def refuse(name, value):
    """Return the error about a parameter, and check that it is one line with the name and the value."""
    with pytest.raises(ProgramError) as caught:
        read_config({name: value})
    text = str(caught.value)
    assert "~" + name in text
    assert "\n" not in text
    return text


def test_no_parameters_are_the_defaults():
    config = read_config({})
    assert config == DriverConfig()
    assert (config.host, config.port) == ("0.0.0.0", 11411)


def test_a_configuration_cannot_be_changed():
    with pytest.raises(dataclasses.FrozenInstanceError):
        read_config({}).port = 1


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_parameter_has_a_text_and_a_default_that_is_allowed(name):
    default = PARAMETERS[name].default
    assert PARAMETERS[name].text
    if name == "allow":
        default = list(default)
    assert getattr(read_config({name: default}), name) == PARAMETERS[name].default


def test_values_come_where_they_belong():
    config = read_config(
        {
            "host": "10.42.0.1",
            "port": 0,
            "max_topics": 10,
            "silence_timeout_s": 8,
            "allow_self_tuning": True,
            "wheel_separation_m": 0.0635,
            "allow": ["10.42.0.0/24", "fe80::/10"],
            "max_unidentified": 7,
        }
    )
    assert (config.host, config.port, config.allow_self_tuning) == ("10.42.0.1", 0, True)
    assert type(config.silence_timeout_s) is float
    assert config.max_topics == 10
    assert config.silence_timeout_s == 8.0
    assert config.max_payload_length == 4096
    assert config.find_geometry("/hero_0", "hero") == WheelGeometry(0.0492, 0.0635, 288.0)
    networks = (ipaddress.ip_network("10.42.0.0/24"), ipaddress.ip_network("fe80::/10"))
    assert (config.allow, config.max_connections, config.max_unidentified) == (networks, 400, 7)
    assert config.max_connections_per_address == 400


# Unknown names.


def test_an_unknown_parameter_is_refused_with_the_name_that_was_meant():
    assert "did you mean ~silence_timeout_s?" in refuse("silence_timeout", 5.0)
    assert "known are: allow, allow_self_tuning, calibration_folder," in refuse("xyzzy", 1)
    assert "did you mean" not in refuse("xyzzy", 1)


# Numbers.


@pytest.mark.parametrize("name", NUMBERS)
def test_the_limits_of_a_number_are_allowed_and_what_lies_beyond_is_not(name):
    low, high = PARAMETERS[name].limits
    assert getattr(read_config({name: low}), name) == low
    assert getattr(read_config({name: high}), name) == high
    for value in (low - 1, high + 1, -math.inf, math.inf, math.nan):
        text = refuse(name, value)
        assert repr(value) in text
        assert "from %.15g to %.15g" % (low, high) in text


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("value", ["11411", "", True, None, [1], {}])
def test_what_is_no_number_is_refused(name, value):
    assert "number from" in refuse(name, value)


def test_a_whole_number_may_be_written_with_a_point_and_a_half_may_not():
    assert read_config({"port": 11412.0}).port == 11412
    assert type(read_config({"port": 11412.0}).port) is int
    assert "a whole number" in refuse("port", 11412.5)


# Choices, texts, switches.


@pytest.mark.parametrize("name", CHOICES)
def test_only_the_choices_are_allowed(name):
    for option in nonempty(PARAMETERS[name].choices):
        assert getattr(read_config({name: option}), name) == option
    for value in ("none", "", 1, True, ["robot"], {"a": 1}):
        assert "one of: " + ", ".join(PARAMETERS[name].choices) in refuse(name, value)


def test_a_switch_is_true_or_false():
    name = "allow_self_tuning"
    assert getattr(read_config({name: True}), name) is True
    for value in (1, 0, "true", "yes", None):
        assert "true or false" in refuse(name, value)


@pytest.mark.parametrize("value", [11411, True, None, ["0.0.0.0"]])
def test_the_host_is_a_text(value):
    assert "a text" in refuse("host", value)


# Lists.


@pytest.mark.parametrize("value", ["10.0.0.0/8", [10], ["10.0.0.0/33"], ["10.42.0.1/24"], ["robots"], [None], {}])
def test_what_is_no_list_of_networks_is_refused(value):
    assert "networks such as 10.42.0.0/24" in refuse("allow", value)


@pytest.mark.parametrize("name", DIAGONALS)
def test_a_covariance_is_six_numbers_that_are_not_negative(name):
    assert getattr(read_config({name: [0, 1, 2.5, 3, 4, 5]}), name) == (0.0, 1.0, 2.5, 3.0, 4.0, 5.0)
    others = ([-1.0] + [0.0] * 5, [math.nan] * 6, [math.inf] * 6, ["1"] * 6, [True] * 6)
    for value in ([0.0] * 5, [0.0] * 36, 1.0, *others):
        assert "6 numbers" in refuse(name, value)


yaml_values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=10)),
    lambda children: st.one_of(
        st.lists(children, max_size=3), st.dictionaries(st.sampled_from(["host", "port", "x"]), children, max_size=3)
    ),
    max_leaves=6,
)


@given(name=st.sampled_from(sorted(PARAMETERS)), value=yaml_values)
def test_any_value_is_taken_or_refused_in_one_line(name, value):
    try:
        read_config({name: value})
    except ProgramError as error:
        assert "~" + name in str(error)
        assert "\n" not in str(error)


def test_wheels_of_calibrated_robots_are_read_from_their_files(tmp_path):
    (tmp_path / "hero_3.yaml").write_text("robot: hero_3\nwheels_m: [0.049, 0.0495, 0.0641]\n")
    (tmp_path / "hero_4.yaml").write_text("robot: hero_4\nmotor_centers_us: [1500, 1510]\n")
    settings = read_config({"calibration_folder": str(tmp_path)})
    assert list(settings.own_wheels) == ["hero_3"]
    wheels = settings.find_geometry("hero_3", "hero")
    assert wheels.wheel_diameter_m == pytest.approx(0.04925) and wheels.wheel_separation_m == 0.0641
    assert wheels.diameter_ratio == pytest.approx(0.0495 / 0.049) and wheels.ticks_per_turn == 288.0
    (tmp_path / "hero_3.yaml").write_text("robot: hero_3\nwheels_m: [0.01, 0.01, 1.0]\nticks_per_turn: 1\n")
    wheels = read_config({"calibration_folder": str(tmp_path)}).find_geometry("hero_3", "hero")
    assert (wheels.wheel_diameter_m, wheels.wheel_separation_m, wheels.ticks_per_turn) == (0.01, 1.0, 1.0)
    (tmp_path / "hero_3.yaml").write_text("robot: hero_3\nmodel: hero_plus\nwheels_m: [0.05, 0.05, 0.0641]\n")
    wheels = read_config({"calibration_folder": str(tmp_path)})
    assert wheels.own_wheels["hero_3"].others["model"] == "hero_plus"


def test_hero_plus_has_its_own_wheels_and_keeps_its_ticks_when_calibrated(tmp_path):
    (tmp_path / "hero_7.yaml").write_text("robot: hero_7\nwheels_m: [0.0501, 0.0499, 0.0652]\n")
    (tmp_path / "hero_8.yaml").write_text("robot: hero_8\nwheels_m: [0.05, 0.05, 0.065]\nticks_per_turn: 100\n")
    given = {"calibration_folder": str(tmp_path), "ticks_per_turn": 300.0}
    settings = read_config(given)
    assert settings.find_geometry("hero_4", "hero_plus").ticks_per_turn == 96.0
    assert settings.find_geometry("hero_5", "hero").ticks_per_turn == 300.0
    assert settings.find_geometry("hero_7", "hero_plus").wheel_separation_m == 0.0652
    assert settings.find_geometry("hero_7", "hero_plus").ticks_per_turn == 96.0
    assert settings.find_geometry("hero_8", "hero_plus").ticks_per_turn == 100.0


def test_a_damaged_file_leaves_its_robot_alone_uncalibrated(tmp_path):
    (tmp_path / "hero_3.yaml").write_text("robot: hero_3\nwheels_m: [49, 49.5, 63]\n")
    (tmp_path / "hero_4.yaml").mkdir()
    (tmp_path / "hero_7.yaml").write_text("robot: hero_7\nmodel: hero_plus\nwheels_m: [0.0501, 0.0499, 0.0652]\n")
    (tmp_path / "hero_9.yaml").write_text("robot: hero_9\nwheels_m: [0.049, 0.049, 0.0641]\n")
    settings = read_config({"calibration_folder": str(tmp_path)})
    assert list(settings.calibration_problems) == ["hero_3", "hero_4"]
    refusal = "hero_3.yaml, line 2: wheels_m is 49, but must be a number from 0.01 to 1"
    assert refusal in settings.calibration_problems["hero_3"]
    assert settings.find_geometry("hero_3", "hero") == DriverConfig().find_geometry("hero_3", "hero")
    assert settings.find_geometry("hero_7", "hero_plus").wheel_separation_m == 0.0652
    assert settings.find_geometry("hero_9", "hero").wheel_separation_m == 0.0641
