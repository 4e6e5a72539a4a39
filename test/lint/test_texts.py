"""House rules that can be read off the text of a file; ruff knows the others."""

import ast
import os
import re

import sources

MAX_FILE_LINES = 500
MAX_TEST_NAME = 70
MAX_PACE_S = 0.1
WITHOUT = ("hero_examples", "hero_test")
"""A module's docstring is enough for their short programs and watchers."""

SUFFIXES = ("", *".py .md .rst .launch .test .xml .yaml .yml .toml .txt .msg .srv .action .urdf".split())
CHOSEN = os.environ.get("HERO_LINT_FILES", "").split("\n")  # of script/lint FILE ...
PYTHON = [path for path in sources.list_python_files() if CHOSEN == [""] or sources.name_of(path) in CHOSEN]
TESTS = [path for path in PYTHON if "test" in path.parts and not {"bench", "src"} & set(path.parts)]


def dotted_name(node):
    """`time.sleep` of the expression time.sleep; empty for anything that is not a plain name."""
    if isinstance(node, ast.Attribute):
        return f"{dotted_name(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def has_docstring(node):
    return isinstance(node, ast.FunctionDef) and bool(ast.get_docstring(node))


def test_nothing_is_left_to_do_in_a_text():
    pattern = re.compile(r"\b(TODO|FIXME|XXX|HACK)\b|^(<{7}|>{7}|={7}$)", re.MULTILINE)
    for path in sources.list_files():
        if path.suffix in SUFFIXES and path.name != "test_texts.py":
            found = pattern.search(path.read_text(encoding="utf-8", errors="replace"))
            assert not found, f"{sources.name_of(path)}: {found.group()}"


def test_files_are_short():
    for path in PYTHON:
        assert len(path.read_text(encoding="utf-8").splitlines()) <= MAX_FILE_LINES, sources.name_of(path)


def test_names_of_tests_are_short():
    for path in TESTS:
        for node in sources.walk(path):
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                assert len(node.name) <= MAX_TEST_NAME, f"{sources.name_of(path)}: {node.name}"


def test_names_of_modules_say_what_they_hold():
    for path in sources.list_source_modules().values():
        words = set(re.split(r"[_.]", path.name))
        assert not words & {"utils", "util", "helpers", "helper", "manager", "misc"}, sources.name_of(path)


def test_tests_wait_on_conditions_not_on_sleeps():
    """A sleep may pace a loop that has a condition and a deadline; a longer one elsewhere is a guess."""
    for path in TESTS:
        nodes = sources.walk(path)
        calls = [node for node in nodes if isinstance(node, ast.Call)]
        sleeps = [call for call in calls if dotted_name(call.func) in ("time.sleep", "rospy.sleep")]
        loops = [node for node in nodes if sleeps and isinstance(node, (ast.While, ast.For))]
        in_loops = {id(node) for loop in loops for node in ast.walk(loop)}
        for sleep in sleeps:
            argument = sleep.args[0]
            paces = isinstance(argument, ast.Constant) and argument.value <= MAX_PACE_S
            where = f"{sources.name_of(path)}:{sleep.lineno}"
            assert paces or id(sleep) in in_loops, f"{where}: sleep as synchronization"


def test_public_methods_have_or_inherit_a_docstring():
    files = [path for path in sources.list_source_modules().values() if sources.package_of(path) not in WITHOUT]
    found = [node for path in files for node in sources.walk(path) if isinstance(node, ast.ClassDef)]
    bases = {node.name: {dotted_name(base).split(".")[-1] for base in node.bases} for node in found}
    documented = {(node.name, method.name) for node in found for method in node.body if has_docstring(method)}

    def inherits(name, method):
        return any((base, method) in documented or inherits(base, method) for base in bases.get(name, ()))

    for node in [node for node in found if not node.name.startswith("_")]:
        for method in [method for method in node.body if isinstance(method, ast.FunctionDef)]:
            if not method.name.startswith("_") and not has_docstring(method):
                assert inherits(node.name, method.name), f"{node.name}.{method.name} has no docstring"


def test_docstrings_name_a_thing_or_an_action():
    private = re.compile(r"^ *\"\"\"(See|What|How|Who|Where|Let|Of|Between|Whether|From)\b.*", re.MULTILINE)
    for path in [path for path in PYTHON if "test" not in path.parts]:
        found = private.search(path.read_text(encoding="utf-8"))
        assert not found, f"{sources.name_of(path)}: {found.group()}"


def test_names_of_bounds_begin_with_min_or_max():
    private = re.compile(r"_?(LEAST|MOST|MAX_FLOAT|LONGEST|FARTHEST|SMALLEST|SHORTEST)_[A-Z]")
    for path in PYTHON:
        for node in sources.walk(path):
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                assert not private.match(node.id), f"{sources.name_of(path)}: {node.id}: MIN_ or MAX_"


def test_texts_of_programs_name_whom_they_mean():
    private = re.compile(r"\b(nobody|somebody|anybody|everybody|whoever)\b", re.IGNORECASE)
    for path in [*sources.list_source_modules().values(), *sources.list_files(".md")]:
        found = private.search(path.read_text(encoding="utf-8"))
        assert not found, f"{sources.name_of(path)}: {found.group()}: a program, user, robot or subscriber?"
