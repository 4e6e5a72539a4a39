"""Numbers of documents are those of the constants that hold them, in packages whose own tests do not compare them."""

import ast
import contextlib
import math
import re

import pytest

import sources

NUMBER = r"(-?\d+(?:\.\d+)?|five|six|eight)"
WORDS = {"five": 5.0, "six": 6.0, "eight": 8.0}
MM, CM, MS = 1e-3, 1e-2, 1e-3
S_IN_MS = 1e3

ROBOTS, CALIBRATION, DRIVER = "docs/robot_interface.md", "docs/calibration.md", "hero_driver/README.md"
SWARM, LOCALIZATION, EXAMPLES = "options/hero_swarm/README.md", "docs/localization.md", "hero_examples/README.md"
TOOLS = "options/hero_tools/README.md"
LIMITS = (
    # Page, what it says with {} for the number, its unit in that of the constant, package and constant.
    (ROBOTS, "linear.x -0.20..{} m/s", 1.0, "hero_node", "MAX_LINEAR_M_S"),
    (ROBOTS, "angular.z -8..{} rad/s", 1.0, "hero_node", "MAX_ANGULAR_RAD_S"),
    (ROBOTS, "| off after {} s |", S_IN_MS, "hero_sim", "LED_WATCHDOG_MS"),
    (ROBOTS, "1500 stops | stops after {} s |", S_IN_MS, "hero_sim", "MOTOR_WATCHDOG_MS"),
    (ROBOTS, "| the same | stops after {} s |", 1.0, "hero_node", "MAX_WATCHDOG_S"),
    (ROBOTS, "diameter, separation | {}, 63 mm", MM, "hero_node", "WHEEL_DIAMETER_M"),
    (ROBOTS, "diameter, separation | 49.2, {} mm", MM, "hero_node", "WHEEL_SEPARATION_M"),
    (ROBOTS, "| body radius | {} mm", MM, "hero_node", "BODY_RADIUS_M"),
    (DRIVER, "sent at least {} ms apart", MS, "hero_driver", "COMMAND_INTERVAL_S"),
    (DRIVER, "zeros every {} ms until", MS, "hero_driver", "INTERVAL_S"),
    (DRIVER, "no wheel motion in {} readings", 1.0, "hero_driver", "REST_READINGS"),
    (DRIVER, "still turn {} s after a zero", 1.0, "hero_driver", "ZERO_SHOWS_S"),
    (DRIVER, "again or {} s have passed", 1.0, "hero_driver", "LATE_ANSWER_S"),
    (DRIVER, "robots for up to {} s, and names", 1.0, "hero_driver", "STOP_LIMIT_S"),
    (CALIBRATION, "Place robots 40 cm apart, their fronts {} cm", CM, "hero_calibration", "WALL_M"),
    (CALIBRATION, "that moves {} cm, by odometry", CM, "hero_calibration", "MAX_MOVE_M"),
    (CALIBRATION, "Sweeps that do not agree to {} us", 1.0, "hero_calibration", "AGREE_US"),
    (CALIBRATION, "by the median slope of {} speeds", 1.0, "hero_calibration", "FIT_POINTS"),
    (CALIBRATION, "accelerates from rest to {} m/s", 1.0, "hero_calibration", "STEP_M_S"),
    (CALIBRATION, "plus {} of the overshoot", 1.0, "hero_calibration", "OVERSHOOT_WEIGHT"),
    (LOCALIZATION, "occluded or out of view for {} s", 1.0, "hero_localization", "LOST_S"),
    (LOCALIZATION, "to {} s off the driver's is", 1.0, "hero_localization", "AHEAD_S"),
    (LOCALIZATION, "If the tags are not {} mm above", MM, "hero_localization", "DEFAULT_HEIGHT_M"),
    (SWARM, "A robot whose pose is older than {} s senses", 1.0, "hero_swarm", "MAX_AGE_S"),
    (SWARM, "and the safety filter at {} Hz", 1.0, "hero_swarm", "RATE_HZ"),
    (SWARM, "(std_msgs/Float32: per second, for {} s)", 1.0, "hero_swarm", "DEPOSIT_S"),
    (TOOLS, "if no driver reports within {} s", 1.0, "hero_tools", "DRIVER_TIMEOUT_S"),
    (TOOLS, "or has not moved ({} m or", 1.0, "hero_tools", "MOVED_M"),
    (EXAMPLES, "A robot without progress for {} s moves aside", 1.0, "hero_client", "PATIENCE_S"),
)


def read_constant(package, name):
    """Return the number that one module of a package sets, maybe computed from others that it sets before."""
    found = []
    for module, path in sources.list_source_modules().items():
        if module.split(".")[0] == package and name in path.read_text(encoding="utf-8"):
            values = {"math": math}
            for node in sources.parse(path).body:
                if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                    with contextlib.suppress(NameError, AttributeError):
                        expression = compile(ast.Expression(node.value), str(path), "eval")
                        values[node.targets[0].id] = eval(expression, values)
            found += [values[name]] if name in values else []
    assert len(found) == 1, f"{package} has {len(found)} constants {name}"
    return found[0]


@pytest.mark.parametrize(("page", "text", "unit", "package", "name"), LIMITS, ids=lambda value: str(value)[-40:])
def test_documented_numbers_are_those_of_the_constants(page, text, unit, package, name):
    pattern = re.escape(text).replace(r"\{\}", NUMBER)
    documented = re.findall(pattern, " ".join((sources.ROOT / page).read_text(encoding="utf-8").split()))
    assert documented, f"{page} no longer says: {text}"
    for number in documented:
        assert (WORDS.get(number) or float(number)) * unit == pytest.approx(read_constant(package, name), rel=0.002)


OPTION = re.compile(r"`(--[a-z-]+)(?: [A-Z]+)?` \((\d+(?:\.\d+)?)[;,)]")


def read_defaults(package):
    """Return the numbers that programs of a package take for options that are left out: (option, number)."""
    paths = [path for name, path in sources.list_source_modules().items() if name.partition(".")[0] == package]
    calls = [node for path in paths for node in sources.walk(path) if isinstance(node, ast.Call)]
    for call in calls:
        given = {keyword.arg: keyword.value for keyword in call.keywords}
        if call.args and isinstance(call.args[0], ast.Constant) and isinstance(given.get("default"), ast.Constant):
            yield call.args[0].value, given["default"].value


def test_documented_defaults_of_options_are_those_of_programs():
    found = 0
    for package, folder in sources.PACKAGES.items():
        documented = OPTION.findall((folder / "README.md").read_text(encoding="utf-8"))
        defaults = list(read_defaults(package)) if documented else []
        for option, number in documented:
            if option in dict(defaults):
                found += 1
                assert (option, float(number)) in defaults, f"README of {package}: {option} is not {number}"
    assert found > 10
