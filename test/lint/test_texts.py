"""House rules that can be read off a text: length, left-overs, swallowed errors, words that do not belong."""

import ast
import re

import pytest
import sources

LONGEST_FILE_LINES = 500
LONGEST_PACE_S = 0.1
TEXT_SUFFIXES = (
    ".py .md .launch .test .xml .yaml .yml .toml .txt .msg .srv .action .urdf .rviz .cfg .sh .bash".split()
)
THIS_FILE = sources.ROOT / "test" / "lint" / "test_texts.py"


def is_text(path):
    if path.suffix:
        return path.suffix in TEXT_SUFFIXES
    return b"\0" not in path.read_bytes()[:1024]


TEXTS = [path for path in sources.list_files() if is_text(path) and path != THIS_FILE]
PYTHON = sources.list_python_files()


def name_of(path):
    return str(path.relative_to(sources.ROOT))


def dotted_name(node):
    """`time.sleep` of the expression time.sleep; empty for anything that is not a plain name."""
    if isinstance(node, ast.Attribute):
        return f"{dotted_name(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def find_lines(path, pattern):
    lines = enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    return [f"{name_of(path)}:{number}: {line}" for number, line in lines if re.search(pattern, line)]


@pytest.mark.parametrize("path", TEXTS, ids=name_of)
def test_no_line_ends_in_spaces_and_the_file_in_one_newline(path):
    assert not find_lines(path, r"[ \t]+$|\t")
    text = path.read_text(encoding="utf-8")
    assert not text or (text.endswith("\n") and not text.endswith("\n\n"))


@pytest.mark.parametrize("path", TEXTS, ids=name_of)
def test_nothing_is_left_to_do_in_the_text(path):
    assert not find_lines(path, r"\b(TODO|FIXME|XXX|HACK)\b")
    assert not find_lines(path, r"^(<{7}|>{7}|={7}$)")


@pytest.mark.parametrize("path", PYTHON, ids=name_of)
def test_files_are_short(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE_LINES


@pytest.mark.parametrize("path", PYTHON, ids=name_of)
def test_no_error_is_swallowed(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ExceptHandler):
            where = f"{name_of(path)}:{node.lineno}"
            assert node.type is not None, f"{where}: bare except"
            broad = isinstance(node.type, ast.Name) and node.type.id in ("Exception", "BaseException")
            only_pass = all(isinstance(statement, ast.Pass) for statement in node.body)
            assert not (broad and only_pass), f"{where}: swallows every error"


@pytest.mark.parametrize("path", [path for path in PYTHON if "test" in path.parts], ids=name_of)
def test_tests_wait_on_conditions_not_on_sleeps(path):
    """A sleep may pace a loop that has a condition and a deadline; a longer one elsewhere is a guess."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    loops = [node for node in ast.walk(tree) if isinstance(node, (ast.While, ast.For))]
    in_loops = {id(node) for loop in loops for node in ast.walk(loop)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and dotted_name(node.func) in ("time.sleep", "rospy.sleep"):
            argument = node.args[0]
            paces = isinstance(argument, ast.Constant) and argument.value <= LONGEST_PACE_S
            assert paces or id(node) in in_loops, f"{name_of(path)}:{node.lineno}: sleep as synchronisation"


@pytest.mark.parametrize("path", [path for path in PYTHON if "src" in path.parts], ids=name_of)
def test_names_of_modules_say_what_they_do(path):
    assert not set(re.split(r"[_.]", path.name)) & {"utils", "util", "helpers", "helper", "manager", "misc"}


@pytest.mark.parametrize("path", [path for path in PYTHON if "src" in path.parts], ids=name_of)
def test_errors_are_called_errors(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ClassDef):
            bases = {dotted_name(base).split(".")[-1] for base in node.bases}
            if any(base.endswith(("Error", "Exception")) for base in bases):
                assert node.name.endswith("Error"), f"{name_of(path)}:{node.lineno}"


@pytest.mark.parametrize("package", sources.list_packages())
def test_every_package_has_a_readme_that_begins_with_its_name(package):
    readme = sources.ROOT / package / "README.md"
    assert readme.is_file()
    assert readme.read_text(encoding="utf-8").splitlines()[0] == f"# {package}"
