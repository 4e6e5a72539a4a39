"""Loops of tests run: one over nothing would assert nothing, and pass."""

import ast

import pytest

import sources

LINT = sources.ROOT / "test" / "lint"  # its loops are over what the repository has
TESTS = [path for path in sources.list_python_files() if path.name.startswith("test_") and LINT not in path.parents]
FULL = ("nonempty", "maybe_empty", "count", "cycle", "arange", "linspace", "randint", "uniform", "make_bad_yaml")
"""Are called for a number of items."""

PASSED_ON = (
    "dict",
    "enumerate",
    "iter",
    "list",
    "permutations",
    "product",
    "reversed",
    "set",
    "sorted",
    "tuple",
    "zip",
)
"""Are empty only if one of their arguments is."""


def is_assert(node):
    """Return whether a statement or call asserts something, in pytest or unittest."""
    name = getattr(getattr(node, "func", None), "attr", "")
    return isinstance(node, ast.Assert) or name.startswith("assert") or name in ("fail", "raises")


def has_items(node, known):
    """Return whether an expression cannot be empty, given the names of such; constants of modules are not."""
    if isinstance(node, (ast.Tuple, ast.List, ast.Set)):
        return any(not isinstance(item, ast.Starred) or has_items(item.value, known) for item in node.elts)
    if isinstance(node, ast.Dict):
        return any(key is not None or has_items(value, known) for key, value in zip(node.keys, node.values))
    if isinstance(node, ast.Constant):
        return bool(node.value)
    if isinstance(node, (ast.ListComp, ast.GeneratorExp, ast.SetComp, ast.DictComp)):
        return all(not part.ifs and has_items(part.iter, known) for part in node.generators)
    if isinstance(node, ast.BinOp):
        parts = [has_items(part, known) for part in (node.left, node.right)]
        return all(parts) if isinstance(node.op, ast.Mult) else any(parts)
    if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Slice):
        return has_items(node.value, known)
    if isinstance(node, ast.Call):
        name = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name in ("items", "keys", "values") and not node.args:
            return has_items(node.func.value, known)
        if name == "range":
            return all(not isinstance(part, ast.Call) or not part.args for part in node.args)  # not range(len(found))
        return name in FULL or (name in PASSED_ON and all(has_items(part, known) for part in node.args))
    name = ast.unparse(node).split(".")[-1]
    return name.isupper() or ast.unparse(node) in known


def find_known(function, loop):
    """Return the names in a test that are not empty before a loop: arguments, what is assigned, what asserts say."""
    known = {argument.arg for argument in (*function.args.args, *function.args.kwonlyargs)}
    in_loop = {id(inner) for inner in ast.walk(loop)}
    for node in ast.walk(function):
        if is_assert(node) and id(node) not in in_loop:
            known |= {ast.unparse(found) for found in list_asserted(node) if id(found) not in in_loop}
        elif isinstance(node, ast.Assign) and has_items(node.value, known):
            known |= {ast.unparse(target) for target in node.targets}
        elif isinstance(node, (ast.For, ast.comprehension)) and has_items(node.iter, known):
            known |= {ast.unparse(found) for found in ast.walk(node.target) if isinstance(found, ast.Name)}
        elif isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And):
            known |= {ast.unparse(found) for found in ast.walk(node.values[0]) if id(found) not in in_loop}
    return known


def is_property(function):
    """Return whether hypothesis makes the examples of a test, empty ones among them."""
    return any("given(" in ast.unparse(decorator) for decorator in function.decorator_list)


def list_asserted(node):
    parts = [node.test] if isinstance(node, ast.Assert) else node.args
    return [
        found for part in parts for found in ast.walk(part) if isinstance(found, (ast.Name, ast.Attribute, ast.Call))
    ]


def find_empty(path):
    """Yield the iterables of loops with asserts, and of all(), in the tests of a file, that may be empty."""
    for function in sources.walk(path):
        if isinstance(function, ast.FunctionDef) and function.name.startswith("test_") and not is_property(function):
            for node in ast.walk(function):
                parts = []
                if isinstance(node, ast.For) and any(map(is_assert, ast.walk(node))):
                    parts = [node.iter]
                elif isinstance(node, ast.Call) and ast.unparse(node.func) == "all":
                    parts = [part.iter for part in getattr(node.args[0], "generators", [])]
                known = find_known(function, node) if parts else set()
                yield from (part for part in parts if not has_items(part, known))


@pytest.mark.parametrize("path", TESTS, ids=sources.name_of)
def test_loops_with_asserts_are_over_something(path):
    places = [f"{found.lineno}: {ast.unparse(found)}" for found in find_empty(path)]
    assert not places, "for ... in nonempty(...), or in maybe_empty(...), of hero_test.nonempty: " + "; ".join(places)


@pytest.mark.parametrize(
    ("code", "is_known"),
    [
        ("for x in (1, 2): assert x", True),
        ("for x in find(): assert x", False),
        ("for x in nonempty(find()): assert x", True),
        ("found = find()\n    assert len(found) == 2\n    for x in found: assert x", True),
        ("found = find()\n    for x in found: assert found[x]", False),
        ("assert all(x for x in find())", False),
        ("assert all(x for x in LIMITS)", True),
        ("for x, y in zip((1, 2), find()): assert x == y", False),
    ],
)
def test_loops_over_nothing_are_found(tmp_path, code, is_known):
    path = tmp_path / "test_x.py"
    path.write_text(f"def test_x():\n    {code}\n")
    assert (list(find_empty(path)) == []) == is_known


def test_marks_are_of_tests():
    """One of a helper marks nothing: pytest takes it, and the test that it was for runs without."""
    definitions = (ast.FunctionDef, ast.ClassDef)
    helpers = [
        (path.name, node.name)
        for path in TESTS
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, definitions) and not node.name.lower().startswith("test")
        if any("pytest.mark." in ast.unparse(decorator) for decorator in node.decorator_list)
    ]
    assert not helpers
