"""Other values in the text of a YAML file, whose comments and order stay. Knows no ROS."""

from typing import Any, List, Mapping, Tuple

import yaml

from .yaml_text import YamlError, parse_yaml

_Edit = Tuple[int, int, str]
"""First character that is replaced, the first one that is kept again, and the new text."""


def dump_yaml(content: Mapping[Any, Any]) -> str:
    """Return a mapping as YAML, each innermost collection in one line; empty for an empty one."""
    return "".join(_dump(key, value) for key, value in content.items())


def _dump(key: Any, value: Any) -> str:
    # PyYAML puts innermost collections into one line, also that of a key and a number.
    flow_style = None if isinstance(value, (dict, list)) else False
    return str(yaml.safe_dump({key: value}, sort_keys=False, default_flow_style=flow_style))


def replace_values(text: str, content: Mapping[str, Any]) -> str:
    """Return text, a mapping in YAML, with content instead; comments and what is equal in both stay as they are.

    A text with aliases or a flow mapping (JSON) is written anew.
    """
    try:
        edited = _edit(text, content)
        # As texts: values may be shared, which takes as long as all of them written out, or hold themselves.
        if yaml.safe_dump(parse_yaml(edited) or {}) == yaml.safe_dump(dict(content)):
            return edited
    except (YamlError, yaml.YAMLError):
        pass  # no mapping that can be edited
    return dump_yaml(content)


def _edit(text: str, content: Mapping[str, Any]) -> str:
    text += "\n" if text and not text.endswith("\n") else ""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    if root is None:
        return text + dump_yaml(content)
    events = yaml.parse(text, Loader=yaml.SafeLoader)
    if any(isinstance(event, yaml.AliasEvent) for event in events):
        # To compare values that are shared takes as long as all of them written out, or for ever.
        return str(yaml.safe_dump(dict(content), sort_keys=False, default_flow_style=False))
    if not isinstance(root, yaml.MappingNode):
        return dump_yaml(content)
    edits: List[_Edit] = []
    _edit_mapping(text, root, content, edits)
    for start, end, replacement in sorted(edits, reverse=True):
        text = text[:start] + replacement + text[end:]
    return text


def _edit_mapping(text: str, node: yaml.MappingNode, content: Mapping[Any, Any], edits: List[_Edit]) -> None:
    """Collect the edits that turn a block mapping into content."""
    loader = yaml.SafeLoader("")
    added = dict(content)
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if key not in content:
            edits.append((key_node.start_mark.index - key_node.start_mark.column, _end_line(text, value_node), ""))
            continue
        value = added.pop(key)
        if loader.construct_object(value_node, deep=True) == value:
            continue
        if isinstance(value, dict) and value and isinstance(value_node, yaml.MappingNode) and not value_node.flow_style:
            _edit_mapping(text, value_node, value, edits)
        else:
            line = yaml.safe_dump(value, default_flow_style=True, width=10**6).split("\n...")[0].strip()
            edits.append((key_node.end_mark.index, _end(value_node), ": " + line))
    if added:
        indent = " " * node.start_mark.column
        lines = "".join(indent + line for line in dump_yaml(added).splitlines(keepends=True))
        # At the end of the file, or below the last line of the mapping.
        place = len(text) if not indent else _end_line(text, node)
        edits.append((place, place, lines))


def _end(node: yaml.Node) -> int:
    """Return where a value ends, without the comments below it that PyYAML counts to a block."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    return int(node.end_mark.index)


def _end_line(text: str, node: yaml.Node) -> int:
    """Return where the line after the last one of a value begins."""
    return text.find("\n", _end(node)) + 1 or len(text)
