"""Tables of parameters for documents, from their declarations. Pure."""

from typing import Any, List, Mapping

import yaml

from .parameters import Parameter

__all__ = ["make_table", "write_default"]


def make_table(declared: Mapping[str, Parameter]) -> List[str]:
    """Return the lines of a table in Markdown: name, default, what is allowed with its unit, meaning."""
    lines = ["| Parameter | Default | Range | Meaning |", "|---|---|---|---|"]
    for name, parameter in declared.items():
        allowed = " ".join(part for part in (_describe(parameter), parameter.unit) if part)
        cells = ("`%s`" % write_default(parameter), allowed, parameter.text)
        lines.append("| `~%s` | %s |" % (name, " | ".join(cells)))
    return lines


def write_default(parameter: Parameter) -> str:
    """Return the default as it is written in YAML."""
    default: Any = parameter.default
    value = list(default) if isinstance(default, tuple) else default
    return str(yaml.safe_dump(value, default_flow_style=True)).split("\n", 1)[0]


def _describe(parameter: Parameter) -> str:
    if parameter.limits is not None:
        return "%s to %s" % tuple(f"{limit:,}" for limit in parameter.limits)
    if isinstance(parameter.default, bool):
        return "true, false"
    return ", ".join("`%s`" % option for option in parameter.choices)
