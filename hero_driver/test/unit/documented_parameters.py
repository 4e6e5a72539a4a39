"""How the fields of DriverConfig stand in the README and in the YAML file; shared by the test and by people.

    python3 documented_parameters.py     prints the README's table and the YAML file, to be pasted
"""

import dataclasses
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
    lines = ["# All parameters of the driver with their defaults; the README of hero_driver explains them.", ""]
    for field in dataclasses.fields(DriverConfig):
        unit = " (%s)" % field.metadata["unit"] if field.metadata["unit"] else ""
        lines += textwrap.wrap(field.metadata["text"] + unit, 100, initial_indent="# ", subsequent_indent="# ")
        value = yaml.safe_dump(as_yaml_value(field.default), default_flow_style=True).split("\n")[0]
        lines.append("%s: %s" % (field.name, value))
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print("\n".join(make_rows()))
    print()
    print(make_yaml(), end="")
