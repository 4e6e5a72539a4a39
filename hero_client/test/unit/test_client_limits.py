"""Limits that the documents state, read from their pages: what is changed in one place only is noticed."""

import inspect
from pathlib import Path

import pytest

from hero_client.controllers.motion import SILENT_STEPS
from hero_client.controllers.orca import AvoidanceLaw
from hero_client.robots.group import REPEAT_PERIOD_S
from hero_client.robots.robot_base import COMMAND_S, BaseRobot
from hero_client.robots.swarm_base import REPORT_PERIOD_S, BaseSwarm
from hero_client.values.readings import FRESH_S
from hero_node.robot_constants import MAX_ANGULAR_RAD_S, MAX_LINEAR_M_S, MODELS
from hero_test.nonempty import nonempty

ROOT = Path(__file__).resolve().parents[3]


def read(page):
    return " ".join((ROOT / page).read_text(encoding="utf-8").split())


def test_teleoperation_stops_after_the_times_of_its_page():
    keys = pytest.importorskip("hero_client.apps.keyboard_teleop", reason="imports rospy")
    from hero_client.apps.joystick_teleop import SILENCE_S, JoystickMapping

    page = read("hero_bringup/README.md")
    times_s = keys.FIRST_TIMEOUT_S, keys.REPEAT_TIMEOUT_S
    assert "a robot stops %g s after a single press, or %g s after the last repetition" % times_s in page
    assert f"stops {SILENCE_S:g} s after the last `/joy`" in page
    for name, default in nonempty(JoystickMapping._field_defaults.items()):
        assert f"`{name}` ({default})" in page


def test_programs_wait_report_and_keep_distance_as_their_page_says():
    page, law = read("hero_examples/README.md"), AvoidanceLaw()
    assert f"and named every {REPORT_PERIOD_S:g} s" in page
    assert f"or after {SILENT_STEPS * REPEAT_PERIOD_S:g} s without a pose" in page
    assert f"keep {100.0 * law.clearance_m:g} cm from whatever they sense" in page
    assert f"`spacing_m` (at least {law.min_spacing_m:.2f})" in page
    assert f"`linear_m_s` ({law.max_linear_m_s:g}): maximum speed" in page


def test_methods_have_the_limits_of_the_api_page():
    assert f"limited to {MAX_LINEAR_M_S:.2f} m/s and {MAX_ANGULAR_RAD_S:g} rad/s" in read("docs/api.md")
    assert f"..{MAX_LINEAR_M_S:.2f} m/s, angular.z -{MAX_ANGULAR_RAD_S:g}.." in read("docs/robot_interface.md")
    assert f"for about {COMMAND_S:g} s at most" in inspect.getdoc(BaseRobot.drive)
    assert f"if odometry is older than {FRESH_S:g} s" in inspect.getdoc(BaseRobot.pose)
    apart_m = [AvoidanceLaw(body_m=model.body_radius_m).min_spacing_m for model in MODELS.values()]
    # The page rounds up.
    assert "at least 0.18 m apart (HeRo+: 0.23 m)" in read("docs/api.md") and 0.17 < apart_m[0] <= 0.18
    assert 0.22 < apart_m[1] <= 0.23 and "no pose for 2 s" in inspect.getdoc(BaseSwarm.go_to_each)
