"""Lists of parameters for documents, from their declarations. Pure."""

import textwrap
from typing import Any, List, Mapping

import yaml

from hero_node.parameters import Parameter

LINE_LENGTH = 120


def make_list(declared: Mapping[str, Parameter]) -> List[str]:
    """Return an item of a list in Markdown for each parameter: name, default, what else is allowed, meaning."""
    items = []
    for name, parameter in declared.items():
        values = [f"`{write_default(parameter)}`", _describe(parameter)]
        text = f"- `~{name}` ({', '.join(value for value in values if value)}): {parameter.text}"
        items.append("\n".join(textwrap.wrap(text, LINE_LENGTH, subsequent_indent="  ", break_on_hyphens=False)))
    return items


def write_default(parameter: Parameter) -> str:
    """Return the default as it is written in YAML."""
    default: Any = parameter.default
    value = list(default) if isinstance(default, tuple) else default
    return str(yaml.safe_dump(value, default_flow_style=True)).split("\n")[0]


def _describe(parameter: Parameter) -> str:
    """Return what is allowed besides the default, with its unit."""
    if parameter.limits is not None:
        low, high = (f"{limit:,}" for limit in parameter.limits)
        return " ".join(part for part in (low, "to", high, parameter.unit) if part)
    others = [f"`{option}`" for option in parameter.choices if option != parameter.default]
    return " ".join(part for part in (", ".join(others), parameter.unit) if part)
