"""Writes docs/api.md: each line `::: NAME` of api_outline.txt becomes what the docstrings say; imports nothing of ours.

Usage: api_page.py [--check]; --check changes nothing, and ends with 1 if the page is not what the sources say.
"""

import ast
import inspect
import re
import sys
import textwrap
from functools import lru_cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OUTLINE, PAGE = ROOT / "docs" / "site" / "api_outline.txt", ROOT / "docs" / "api.md"
SOURCES = (ROOT / "hero_client" / "src", ROOT / "hero_node" / "src")
WITHOUT_MEMBERS = ("BaseRobot", "BaseSwarm")  # those of Robot and Swarm, which stand above them
FIELD = re.compile(r"^ {4}([\w, ]+): ")


@lru_cache(maxsize=None)
def find_module(name):
    """Return the path and the syntax tree of a module; None if there is none of this name."""
    for source in SOURCES:
        for path in (source / (name.replace(".", "/") + ".py"), source / name.replace(".", "/") / "__init__.py"):
            if path.is_file():
                return path, ast.parse(path.read_text(encoding="utf-8"))
    return None


def find_definition(module, name):
    """Return the module and the node that define a name, in this module or where it is imported from."""
    path, tree = find_module(module)
    for node in tree.body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and node.name == name:
            return module, node
        if isinstance(node, ast.ImportFrom) and any(alias.name == name for alias in node.names):
            package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
            base = ".".join([*package[: len(package) - node.level + 1], *filter(None, [node.module])])
            origin = base if node.level else node.module
            if find_module(origin):
                return find_definition(origin, name)
    return None


def list_members(module, node, seen=()):
    """Return the public methods and properties of a class, its own first, then those of its bases among our classes."""
    members = [item for item in node.body if isinstance(item, ast.FunctionDef) and not item.name.startswith("_")]
    names = {*seen, *(item.name for item in members)}
    for base in node.bases:
        base = base.value if isinstance(base, ast.Subscript) else base  # BaseSwarm[Robot]
        found = find_definition(module, ast.unparse(base)) if isinstance(base, ast.Name) else None
        if found:
            inherited = list_members(*found, names)
            members += [item for item in inherited if item.name not in names]
            names |= {item.name for item in inherited}
    return members


def describe(docstring):
    """Return a docstring as Markdown: indented fields become a list."""
    lines = []
    for line in inspect.cleandoc(docstring or "").splitlines():
        if FIELD.match(line):
            lines.append(FIELD.sub(r"- `\1`: ", line))
        elif line.startswith("    ") and lines and lines[-1].startswith(("- ", "  ")):
            lines.append("  " + line.strip())
        else:
            if line.endswith(":") and not line.startswith(" "):
                line += "\n"
            lines.append(line)
    return "\n".join(lines).strip()


def sign(name, node):
    """Return how a function is called, without self."""
    arguments = node.args
    is_static = any(ast.unparse(one) == "staticmethod" for one in node.decorator_list)
    if not is_static and arguments.args and arguments.args[0].arg in ("self", "cls"):
        arguments.args = arguments.args[1:]
    returns = f" -> {ast.unparse(node.returns)}" if node.returns and ast.unparse(node.returns) != "None" else ""
    return f"{name}({ast.unparse(arguments)}){returns}".replace('"', "'")


def show_code(text):
    """Return a line of Python as a block."""
    lines = textwrap.wrap(text, 116, subsequent_indent="    ", break_long_words=False)
    return "\n".join(["```python", *lines, "```"])


def show_function(node, level):
    """Return heading, signature and docstring; of a property its name alone."""
    if any(ast.unparse(one).endswith("property") for one in node.decorator_list):
        returns = f": {ast.unparse(node.returns)}" if node.returns else ""
        return [f"{level} {node.name}", show_code(node.name + returns), describe(ast.get_docstring(node, False))]
    return [f"{level} {node.name}", show_code(sign(node.name, node)), describe(ast.get_docstring(node, False))]


def show_class(module, node):
    """Return all that a class offers."""
    parts = [f"### {node.name}"]
    found = {item.name: item for item in node.body if isinstance(item, ast.FunctionDef)}
    if "__init__" in found:
        parts.append(show_code(sign(node.name, found["__init__"])))
    parts.append(describe(ast.get_docstring(node, False)))
    if "__init__" in found:
        parts.append(describe(ast.get_docstring(found["__init__"], False)))
    for member in list_members(module, node) if node.name not in WITHOUT_MEMBERS else ():
        setter = [one for one in member.decorator_list if ast.unparse(one).endswith(".setter")]
        parts += [] if setter else show_function(member, "####")
    return parts


def show_module(name):
    """Return all public functions, classes and documented constants of a module."""
    _, tree = find_module(name)
    parts = [f"### {name.rpartition('.')[2]}", describe(ast.get_docstring(tree, False))]
    for node, after in zip(tree.body, [*tree.body[1:], None]):
        target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            parts += show_function(node, "####")
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            parts += [part.replace("### ", "#### ", 1) for part in show_class(name, node)[:2]]
        elif isinstance(target, ast.Name) and isinstance(after, ast.Expr) and target.id.isupper():
            if isinstance(getattr(after.value, "value", None), str) and not target.id.startswith("_"):
                parts.append(f"`{target.id}`: {describe(after.value.value)}")
    return parts


def show(name):
    """Return what the docstrings say of a module, class or function."""
    if find_module(name):
        return show_module(name)
    module, _, last = name.rpartition(".")
    found = find_definition(module, last)
    if found is None:
        sys.exit(f"api_page.py: {OUTLINE.name} names {name}, which is not there")
    origin, node = found
    return show_class(origin, node) if isinstance(node, ast.ClassDef) else show_function(node, "###")


def make_page():
    """Return the text of the page."""
    parts = []
    for block in OUTLINE.read_text(encoding="utf-8").split("\n\n"):
        parts += show(block.strip()[4:]) if block.startswith("::: ") else [block.strip()]
    return "\n\n".join(part for part in parts if part) + "\n"


if __name__ == "__main__":
    if "--check" in sys.argv[1:]:
        sys.exit(PAGE.read_text(encoding="utf-8") != make_page())
    PAGE.write_text(make_page(), encoding="utf-8")
