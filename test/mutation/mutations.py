"""Small changes of a module, each of which a test should notice. Knows syntax trees only.

Left alone is what says rather than does: texts, logging, annotations.
"""

import ast
import copy
from typing import Callable, Iterator, List, NamedTuple, Optional, Tuple

SWAPPED_COMPARISONS = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
SWAPPED_ARITHMETIC = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
LIMITING = ("min", "max", "minimum", "maximum")
SHAPING = ("abs", "sorted", "reversed", "round", "clip", "clamp", "wrap", "limit")
SAYING = "print debug info warn warning error exception logdebug loginfo logwarn logerr log format".split()
SAYING_KEYWORDS = set(
    "alpha color desc description disable edgecolor epilog facecolor fontsize ha help label labelpad leave linestyle"
    " linewidth loc lw marker markersize metavar name rotation showfliers title unit va widths zorder".split()
)
"""Of help, progress bars and drawings: only the eye judges them."""

DRAWING = set(
    "add_argument annotate axhline axvline fill_between grid legend plot set_title set_xlabel set_ylabel text".split()
)
"""The order of these calls is the eye's, too."""

OTHER_MODEL = {
    "BODY_RADIUS_M": 0.060,
    "WHEEL_SEPARATION_M": 0.065,
    "body_radius_m": 0.036835,
    "wheel_separation_m": 0.063,
    "HERO_PLUS": "hero",
    "STOCK": "hero_plus",
}
"""Of constants of one robot's model, and of fields of a model, what the other one has: HeRo+, or the stock robot."""

NAMED = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)


class Mutation(NamedTuple):
    """One change of a syntax tree, not made yet."""

    first_line: int  # of the statement
    last_line: int
    scope: str  # names of the classes and functions round it; empty in the module itself
    at_import: bool  # runs when the module is imported
    before: str
    after: str
    apply: Callable[[], None]

    def describe(self) -> str:
        """In one line."""
        return f"{self.scope or 'module'}: {self.before} -> {self.after}"


def list_mutations(tree: ast.Module) -> List[Mutation]:
    """Return all mutations of a module, in the order of its text; each changes this very tree."""
    return list(_visit(tree, tree, (), True))


def _visit(node: ast.AST, statement: ast.AST, scope: Tuple[str, ...], at_import: bool) -> Iterator[Mutation]:
    in_function = at_import and isinstance(node, FUNCTIONS)
    inner = (*scope, node.name) if isinstance(node, NAMED) else scope
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "format_spec"):
            continue
        # Defaults and decorators of functions run with the module.
        child_at_import = at_import and not (in_function and field == "body")
        places = [(value, index) for index in range(len(value))] if isinstance(value, list) else [(node, field)]
        for holder, key in places:
            child = holder[key] if isinstance(holder, list) else value
            if not isinstance(child, ast.AST) or _only_says(child):
                continue
            own = child if isinstance(child, ast.stmt) else statement
            for replacement in _list_replacements(child, node, field, inner):
                yield _make_mutation(holder, key, child, replacement, own, inner, child_at_import)
            if isinstance(child, ast.stmt) and key + 1 < len(holder) and _may_matter_first(child, holder[key + 1]):
                yield _make_swap(holder, key, inner, child_at_import)
            yield from _visit(child, own, inner, child_at_import)


def _make_mutation(holder, key, child, replacement, statement, scope, at_import) -> Mutation:
    def apply() -> None:
        ast.copy_location(replacement, child)
        if isinstance(holder, list):
            holder[key] = replacement
        else:
            setattr(holder, key, replacement)

    return Mutation(
        statement.lineno,
        child.end_lineno,
        ".".join(scope),
        at_import,
        _to_text(child),
        _to_text(replacement),
        apply,
    )


def _make_swap(statements, index, scope, at_import) -> Mutation:
    first, second = statements[index : index + 2]

    def apply() -> None:
        statements[index : index + 2] = [second, first]

    before, after = f"{_to_text(first)}; {_to_text(second)}", f"{_to_text(second)}; {_to_text(first)}"
    return Mutation(first.lineno, second.end_lineno, ".".join(scope), at_import, before, after, apply)


def _may_matter_first(first: ast.stmt, second: ast.stmt) -> bool:
    """Return whether the order of two statements may matter, and neither only names a value for the other."""
    both = (first, second)
    if not all(isinstance(node, (ast.Expr, ast.Assign, ast.AugAssign, ast.Delete)) for node in both):
        return False
    if any(_name_called(getattr(node, "value", None)) in DRAWING or _declares_option(node) for node in both):
        return False
    if not any(isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) for node in both):
        return False
    named = {node.id for node in ast.walk(first) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
    read = {node.id for node in ast.walk(second) if isinstance(node, ast.Name)}
    return not named & read and not any(_only_says(getattr(node, "value", None)) for node in both)


def _declares_option(node: ast.stmt) -> bool:
    """Return whether a statement adds an option to a parser, under whatever name: --help alone shows their order."""
    first = node.value.args[:1] if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) else []
    return any(isinstance(word, ast.Constant) and str(word.value).startswith("--") for word in first)


def _to_text(node: ast.AST) -> str:
    return " ".join(ast.unparse(node).split())[:90]


def _name_called(node: ast.AST) -> str:
    """The last part of the name that a call calls; empty for anything else."""
    return _name_of(node.func) if isinstance(node, ast.Call) else ""


def _name_of(node: ast.AST) -> str:
    """The last part of a dotted name; empty for anything else."""
    return getattr(node, "attr", getattr(node, "id", ""))


def _only_says(node: Optional[ast.AST]) -> bool:
    is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
    is_formatted = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mod) and isinstance(node.left, ast.Constant)
    return is_text or is_formatted or isinstance(node, ast.JoinedStr) or _name_called(node) in SAYING


def _changed(node: ast.AST, **fields) -> ast.AST:
    changed = copy.copy(node)
    for name, value in fields.items():
        setattr(changed, name, value)
    return changed


def _list_replacements(node: ast.AST, parent: ast.AST, field: str, scope: Tuple[str, ...]) -> List[ast.AST]:
    if isinstance(node, ast.stmt):
        found = _replace_statement(node, scope)
        cleans_up = field == "finalbody" or isinstance(parent, ast.ExceptHandler)
        is_dropped = any(isinstance(replacement, ast.Pass) for replacement in found)
        return [*found, ast.Pass()] if cleans_up and not is_dropped and _does_something(node) else found
    if isinstance(node, ast.ExceptHandler):
        return [_changed(node, type=wider) for wider in _widen(node.type)]
    found: List[ast.AST] = []
    if isinstance(node, ast.Compare):
        for index, operator in enumerate(node.ops):
            swapped = SWAPPED_COMPARISONS[type(operator)]()
            found.append(_changed(node, ops=[*node.ops[:index], swapped, *node.ops[index + 1 :]]))
    elif isinstance(node, ast.BoolOp):
        found.append(_changed(node, op=ast.And() if isinstance(node.op, ast.Or) else ast.Or()))
    elif isinstance(node, ast.UnaryOp):
        if isinstance(node.op, (ast.Not, ast.USub)):
            found.append(node.operand)
    elif isinstance(node, ast.BinOp):
        if type(node.op) in SWAPPED_ARITHMETIC:
            found.append(_changed(node, op=SWAPPED_ARITHMETIC[type(node.op)]()))
        found.append(node.left)
    elif isinstance(node, ast.Call):
        name = _name_called(node)
        if name in LIMITING and len(node.args) > 1:
            found += node.args[:2]
        elif node.args and any(part in name for part in SHAPING):
            found.append(node.args[0])
        if name == "suppress":
            found += [_changed(node, args=[wider]) for wider in _widen(node.args[0])]
        for index, keyword in enumerate(node.keywords):
            if keyword.arg and keyword.arg not in SAYING_KEYWORDS:
                found.append(_changed(node, keywords=[*node.keywords[:index], *node.keywords[index + 1 :]]))
    elif isinstance(node, (ast.Name, ast.Attribute)) and isinstance(node.ctx, ast.Load):
        if _name_of(node) in OTHER_MODEL:
            found.append(ast.Constant(value=OTHER_MODEL[_name_of(node)]))
    elif isinstance(node, ast.Constant):
        if isinstance(node.value, bool):
            found.append(ast.Constant(value=not node.value))
        elif isinstance(node.value, int):
            found.append(ast.Constant(value=node.value + 1))
        elif isinstance(node.value, float):
            found.append(ast.Constant(value=node.value * 2.0 or 1.0))
    is_condition = isinstance(parent, (ast.If, ast.While, ast.IfExp)) and node is parent.test
    if is_condition and isinstance(node, (ast.Name, ast.Attribute, ast.Call)):
        found.append(ast.UnaryOp(op=ast.Not(), operand=node))
    return found


def _widen(caught: Optional[ast.AST]) -> List[ast.AST]:
    """Return what to catch in place of this: every error; of BaseException, no longer Ctrl-C."""
    return [] if caught is None or _name_of(caught) == "Exception" else [ast.Name(id="Exception", ctx=ast.Load())]


def _does_something(node: ast.stmt) -> bool:
    return not isinstance(node, ast.Pass) and not _only_says(getattr(node, "value", None))


def _replace_statement(node: ast.stmt, scope: Tuple[str, ...]) -> List[ast.AST]:
    if isinstance(node, ast.AugAssign):
        swapped = SWAPPED_ARITHMETIC.get(type(node.op))
        return [_changed(node, op=swapped()), ast.Pass()] if swapped else [ast.Pass()]
    if isinstance(node, ast.Assign):
        kept = all(isinstance(target, (ast.Attribute, ast.Subscript)) for target in node.targets)
        return [ast.Pass()] if kept and "__init__" not in scope else []
    if isinstance(node, ast.Expr):
        return [ast.Pass()] if isinstance(node.value, ast.Call) and not _only_says(node.value) else []
    if isinstance(node, ast.Raise):
        return [ast.Pass()]
    if isinstance(node, ast.Continue):
        return [ast.Pass(), ast.Break()]
    return [ast.Continue()] if isinstance(node, ast.Break) else []
