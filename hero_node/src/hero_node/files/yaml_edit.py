"""Other values in the text of a YAML file, whose other comments and order stay. Knows no ROS."""

from typing import Any, Mapping

import yaml

from .yaml_text import YamlError, parse_yaml


def dump_yaml(content: Mapping[Any, Any]) -> str:
    """Return a mapping as YAML, each innermost collection in one line; empty for an empty one."""
    return "".join(_dump(key, value) for key, value in content.items())


def _dump(key: Any, value: Any) -> str:
    # PyYAML puts innermost collections into one line, also that of a key and a number.
    flow_style = None if isinstance(value, (dict, list)) else False
    return str(yaml.safe_dump({key: value}, sort_keys=False, default_flow_style=flow_style, width=10**6))


def replace_values(text: str, content: Mapping[str, Any]) -> str:
    """Return text, a mapping in YAML, with content instead; entries that are equal in both stay, with their comments.

    Where that does not lead to content, as from a flow mapping (JSON), it is written anew.
    """
    text += "\n" if text and not text.endswith("\n") else ""
    try:
        old, root = parse_yaml(text) or {}, yaml.compose(text, Loader=yaml.SafeLoader)
        added = {key: value for key, value in content.items() if key not in old}
        for key_node, value_node in reversed(root.value if isinstance(root, yaml.MappingNode) else []):
            key = key_node.value
            entry = dump_yaml({key: content[key]}) if key in content else ""
            # As texts: values may be shared, which takes as long as all of them written out, or hold themselves.
            if entry != dump_yaml({key: old.get(key)}):
                end = text.find("\n", _end(value_node)) + 1 or len(text)
                text = text[: key_node.start_mark.index] + entry + text[end:]
        text += dump_yaml(added)
        if yaml.safe_dump(parse_yaml(text) or {}) == yaml.safe_dump(dict(content)):
            return text
    except (YamlError, yaml.YAMLError):
        pass
    return dump_yaml(content)


def _end(node: yaml.Node) -> int:
    """Return where a value ends, without the comments below it that PyYAML counts to a block."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    return int(node.end_mark.index)
