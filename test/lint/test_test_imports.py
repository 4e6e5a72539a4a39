"""Where tests take their helpers from: hero_test, or the folder that they lie in; never from another test's folder."""

import ast

import sources

SHARED = (sources.ROOT / "test", sources.ROOT / "test" / "bench")
"""On the path for every test, by conftest.py."""

PROGRAMS = ("run.py",)
"""Started by scripts, which know where they are."""


FOLDERS = {"unit", "rostest", "faults", "workspaces", "documents", "lint"}


def is_test(path):
    return path.name not in PROGRAMS and bool(FOLDERS & {*path.relative_to(sources.ROOT).parts[:-1]})


TESTS = [path for path in sources.list_python_files() if "test" in path.parts and is_test(path)]
MODULES = {path.stem for path in sources.list_python_files() if "test" in path.parts and "src" not in path.parts}


def changes_path(node):
    """Return whether a statement changes where modules are looked for."""
    targets = getattr(node, "targets", [getattr(node, "target", None)])
    if isinstance(node, ast.Call):
        targets = [node.func] if getattr(node.func, "attr", "") in ("append", "extend", "insert") else []
        targets = [function.value for function in targets]
    elif not isinstance(node, (ast.Assign, ast.AugAssign)):
        return False
    return any(ast.unparse(target).startswith("sys.path") for target in targets)


def test_tests_do_not_change_where_modules_are_looked_for():
    for path in TESTS:
        for node in sources.walk(path):
            assert not changes_path(node), f"{sources.name_of(path)}:{node.lineno}: put helpers into hero_test"


def test_tests_import_helpers_from_hero_test_or_their_own_folder():
    for path in TESTS:
        places = [path.parent, *SHARED]
        if "unit" in path.parts:
            places += [folder for folder in path.parents if "unit" in folder.parts]  # conftest.py is there
        for found in sources.read_imports(path):
            if found.top in MODULES - set(sources.PACKAGES):
                known = any((place / f"{found.top}.py").exists() or (place / found.top).is_dir() for place in places)
                where = f"{sources.name_of(path)}:{found.line}"
                assert known, f"{where}: {found.top} lies beside another test: put it into hero_test"


def test_the_rules_find_tests_and_changes_of_the_path():
    assert len(TESTS) > 200
    assert changes_path(ast.parse("sys.path.insert(0, 'x')").body[0].value)
    assert changes_path(ast.parse("sys.path += ['x']").body[0])
