"""How the fields of DriverConfig stand in the README and in the YAML file; shared by the test and by people.

python3 documented_parameters.py             prints the README's table and the YAML file, to be pasted
python3 documented_parameters.py --page      prints docs/driver_parameters.md
"""

import dataclasses
import fnmatch
import sys
import textwrap

import yaml

from hero_driver.config import DriverConfig


def as_yaml_value(default):
    """Return a default as it is written in YAML."""
    return list(default) if isinstance(default, tuple) else default


def describe_range(field):
    """Return the allowed values of a field, in words."""
    if "options" in field.metadata:
        return ", ".join("`%s`" % option for option in field.metadata["options"])
    if "range" in field.metadata:
        return "%s to %s" % tuple(f"{limit:,}".replace(",", " ") for limit in field.metadata["range"])
    if isinstance(field.default, bool):
        return "true, false"
    return ""


def make_rows():
    """Return the rows of the README's table."""
    return [
        "| `~%s` | %s | %s | %s | %s |"
        % (
            field.name,
            "`%s`" % yaml.safe_dump(as_yaml_value(field.default), default_flow_style=True).split("\n")[0],
            field.metadata["unit"],
            describe_range(field),
            field.metadata["text"],
        )
        for field in dataclasses.fields(DriverConfig)
    ]


def make_yaml():
    """Return the text of config/hero_driver.yaml."""
    lines = [
        "# All parameters of the driver with their defaults; the README of hero_driver explains them.",
        "",
    ]
    for field in dataclasses.fields(DriverConfig):
        unit = " (%s)" % field.metadata["unit"] if field.metadata["unit"] else ""
        lines += textwrap.wrap(
            field.metadata["text"] + unit, 100, initial_indent="# ", subsequent_indent="# "
        )
        value = yaml.safe_dump(as_yaml_value(field.default), default_flow_style=True).split("\n")[0]
        lines.append("%s: %s" % (field.name, value))
    return "\n".join(lines) + "\n"


GROUPS = {
    "Where robots come from": ("host", "port", "robots", "namespace_policy", "allow", "quick_acknowledge"),
    "How much one robot, and all of them, may do": ("max_*", "parameters_outside"),
    "How long the driver waits": ("*_timeout_s", "grace_s", "command_max_age_s"),
    "Commands": ("clamp", "orphan_stop_s", "start_stopped", "allow_self_tuning"),
    "Odometry": ("odometry", "wheel_*", "ticks_per_turn", "pose_covariance", "twist_covariance"),
    "Stamps, transforms, reports": ("stamps", "max_future_s", "max_age_s", "*_period_s"),
    "Others": ("*",),
}
PAGE_HEAD = """# Parameters of the driver

All are private parameters of the node `hero_driver`, read once at its start, and optional. One that is unknown or out
of range ends the node with one line that says which, and what is allowed. Floats in YAML need a point: `1.0e-4`, not
`1e-4`.

Copy the file, change what you need, and name the copy:

    cp $(rospack find hero_driver)/config/hero_driver.yaml my_driver.yaml
    roslaunch hero_bringup hero_bringup.launch config:=$PWD/my_driver.yaml

`host` and `port` of the launch file win over the file. This page is made from the driver's own table (and a test
compares): `python3 hero_driver/test/unit/documented_parameters.py --page > docs/driver_parameters.md`.
"""
TABLE_HEAD = ["| parameter | default | unit | range | meaning |", "|---|---|---|---|---|"]


def make_page():
    """Return the text of docs/driver_parameters.md: the rows of the README in groups."""
    rows = dict(zip((field.name for field in dataclasses.fields(DriverConfig)), make_rows()))
    lines = [PAGE_HEAD]
    # The narrow patterns choose first: max_age_s belongs to the stamps, not to the limits.
    for title, patterns in GROUPS.items():
        exact = {name for others in GROUPS.values() for name in others}
        chosen = [
            name
            for name in rows
            if name in patterns
            or (name not in exact and any(fnmatch.fnmatch(name, pattern) for pattern in patterns))
        ]
        if chosen:
            lines += ["## " + title, "", *TABLE_HEAD, *(rows.pop(name) for name in chosen), ""]
    return "\n".join(lines[:-1]) + "\n"


if __name__ == "__main__":
    if sys.argv[1:] == ["--page"]:
        print(make_page(), end="")
        sys.exit()
    print("\n".join(make_rows()))
    print()
    print(make_yaml(), end="")
