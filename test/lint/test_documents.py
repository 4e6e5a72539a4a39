"""Markdown files: commands name what exists, READMEs list what programs have, promises name tests.

Links are checked by mkdocs (script/docs).
"""

import ast
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from functools import lru_cache

import pytest

import documents
import sources

PACKAGES = sources.PACKAGES
COMMANDS = [command for page in sources.list_files(".md") for command in documents.read_commands(page)]
TEST_NAME = re.compile(r"`(test_\w+)`")
# Begin no command but stand before one.
PREFIXES = ("sudo", "time", "timeout", "env", "exec", "nohup", "do", "then")
NAMES_OF_ROS = {"/tf", "/tf_static", "/rosout", "/rosout_agg", "/diagnostics", "/clock", "/joy", "/odom"}
STAGES = ("lint", "unit", "options", "noetic", "rostest", "noetic_rostest", "faults", "workspaces", "core")
TALKS_ABOUT_NAMES = {
    "rostopic": ("echo", "hz", "bw", "info", "pub", "delay"),
    "rosservice": ("call", "info", "args", "type"),
}


def strip_prefixes(words):
    while words and (words[0] in PREFIXES or re.match(r"^[A-Z_]+=", words[0]) or re.match(r"^[\d.]+s?$", words[0])):
        words = words[1:]
    return words


def commands_of(*programs):
    """Commands that start one of the programs, as (place, words)."""
    for command in COMMANDS:
        words = strip_prefixes(command.words)
        if words and words[0] in programs:
            yield command, words


@lru_cache(maxsize=None)
def read_arguments(package, name):
    """Names of the arguments of a launch file, or None if there is no such file."""
    for path in sources.list_files(".launch"):
        if path.name == name and sources.package_of(path) == package:
            return {argument.get("name") for argument in ElementTree.parse(path).getroot().findall("arg")}
    return None


@lru_cache(maxsize=None)
def read_package_text(package):
    """All of the Python sources of a package, and the pages that it takes scripts from."""
    files = [path for path in sources.list_python_files() if sources.package_of(path) == package]
    pages = re.findall(r"hero_add_page_script\((\S+)", sources.read_cmake(package))
    files += [(PACKAGES[package] / page).resolve() for page in pages]
    return "\n".join(path.read_text(encoding="utf-8") for path in files if "test" not in path.parts)


def find_options(words):
    """Options among the words of a command, without --help, which is everybody's."""
    found = (re.match(r"^(--[\w-]+)", word) for word in words)
    return [option.group(1) for option in found if option and option.group(1) != "--help"]


@lru_cache(maxsize=None)
def read_words(package):
    """Everything between backticks in the README of a package; the topics of robots have a page of their own."""
    lines = documents.read_lines(PACKAGES[package] / "README.md")
    if package == "hero_driver":
        lines += documents.read_lines(sources.ROOT / "docs" / "robot_interface.md")
    return {word for line in lines for word in documents.INLINE.findall(line.text)}


def documented_names():
    """Names of topics and services that the READMEs of the packages list, with N for a robot's number."""
    names = set(NAMES_OF_ROS)
    for package in PACKAGES:
        names |= {word for word in read_words(package) if re.match(r"^/[\w/]+$", word)}
    return names | {"/hero_driver/" + word[1:] for word in read_words("hero_driver") if re.match(r"^~\w+$", word)}


def test_every_roslaunch_names_a_launch_file_and_its_arguments():
    for place, words in commands_of("roslaunch"):
        plain = [word for word in words[1:] if not word.startswith("-")]
        if "-p" in words:
            plain.remove(words[words.index("-p") + 1])
        package, file, *arguments = [*plain, "", ""]
        assert package in PACKAGES or not package.startswith("hero_"), f"{place}: no package {package}"
        if package in PACKAGES:
            known = read_arguments(package, file)
            assert known is not None, f"{place}: {package} has no launch/{file}"
            given = {argument.partition(":=")[0] for argument in arguments if ":=" in argument}
            assert given <= known, f"{place}: {file} has no argument {given - known}"


def test_every_rosrun_names_a_program_its_options_and_parameters():
    for place, words in commands_of("rosrun"):
        package, program, *arguments = [*words[1:], "", ""]
        assert package in PACKAGES or not package.startswith("hero_"), f"{place}: no package {package}"
        if package in PACKAGES:
            assert program in sources.list_programs(package), f"{place}: {package} has no program {program}"
            for option in find_options(arguments):
                assert f'"{option}"' in read_package_text(package), f"{place}: no option {option}"
            for name in re.findall(r"(?:^| )_([a-z]\w*):=", " ".join(arguments)):
                assert re.search(rf"\b{name}\b", read_package_text(package)), f"{place}: no parameter {name}"


def list_rostest_patterns():
    """Places and patterns of `script/test rostest PATTERN`."""
    for place in COMMANDS:
        words = strip_prefixes(place.words)
        if words and words[0].endswith("script/test"):
            for stage, pattern in zip(words[1:], words[2:]):
                if stage in ("rostest", "noetic_rostest") and pattern not in STAGES:
                    yield place, pattern


def test_every_pattern_of_rostests_matches_one():
    patterns = list(list_rostest_patterns())
    assert patterns, "no document names a rostest: take this test out"
    for place, pattern in patterns:
        assert any(pattern in sources.name_of(path) for path in sources.find("test/rostest/*.test")), place


def test_every_script_and_its_options_exist():
    for place in COMMANDS:
        words = strip_prefixes(place.words)
        if words and re.match(r"^(\S*/)?script/\w+$", words[0]):
            path = sources.ROOT / "script" / words[0].split("/")[-1]
            assert path.is_file(), f"{place}: there is no script/{path.name}"
            text = path.read_text(encoding="utf-8")
            programs = re.findall(r"[\w/]+\.py", text) + [f"test/bench/{word}_bench.py" for word in words[1:]]
            files = (sources.ROOT / name for name in programs)
            text += "".join(file.read_text(encoding="utf-8") for file in files if file.is_file())
            for option in find_options(words):
                assert option in text, f"{place}: script/{path.name} has no option {option}"


def test_every_topic_and_service_that_a_command_names_is_in_a_readme():
    documented = documented_names()
    for place, words in commands_of(*TALKS_ABOUT_NAMES):
        if len(words) > 2 and words[1] in TALKS_ABOUT_NAMES[words[0]]:
            for name in [word for word in words[2:] if word.startswith("/")][:1]:
                plain = re.sub(r"/hero_(\d+|N|\$\{?\w+\}?)(?=/|$)", "/hero_N", name)
                plain = re.sub(r"^/hero_driver_\w+", "/hero_driver", plain)  # one of several drivers
                known = any(plain == known or plain.startswith(known + "/") for known in documented)
                assert known or "$" in plain, f"{place}: no README of a package lists {name}"


def test_every_type_that_a_command_shows_exists():
    for place, words in commands_of("rosmsg", "rossrv"):
        folder = words[0][3:]
        for word in words[1:]:
            package, _, kind = word.partition("/")
            if package in PACKAGES and kind:
                assert (PACKAGES[package] / folder / f"{kind}.{folder}").is_file(), f"{place}: {word}"


def test_every_module_that_a_command_runs_has_its_options():
    for place, words in commands_of("python3"):
        module = words[words.index("-m") + 1] if "-m" in words else ""
        if module in PACKAGES:
            for option in find_options(words):
                assert f'"{option}"' in read_package_text(module), f"{place}: no option {option}"


def test_every_option_of_a_program_is_in_the_readme_of_its_package():
    for package in PACKAGES:
        readme = (PACKAGES[package] / "README.md").read_text(encoding="utf-8")
        for option in set(re.findall(r'add_argument\(\s*"(--[\w-]+)"', read_package_text(package))):
            # Or as the argument of a launch file of the same name.
            argument = f"`{option[2:].replace('-', '_')}`"
            assert re.search(rf"`{option}\b", readme) or argument in readme, f"README of {package}: {option}"


def calls_in(package, names):
    """Calls of functions or classes of these names in the package's modules, as (path, call)."""
    for path in sources.list_source_modules().values():
        if sources.package_of(path) == package:
            for node in sources.walk(path):
                if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in names:
                    yield path, node


def test_every_parameter_of_a_program_is_in_the_readme():
    for package in PACKAGES:
        words = read_words(package)
        for path, call in calls_in(package, ("read_parameters",)):
            for key in getattr(call.args[0], "keys", []):
                known = not isinstance(key, ast.Constant) or words & {key.value, f"~{key.value}"}
                assert known, f"{path.name}: parameter {key.value} is not in the README of {package}"


def test_every_topic_and_service_of_a_program_is_in_the_readme():
    for package in set(PACKAGES) - {"hero_test"}:  # it holds no programs
        known = {re.split(r"[/~]", word)[-1] for word in read_words(package)}
        for path, call in calls_in(package, ("Publisher", "Subscriber", "Service")):
            # Of "/hero_%d/odom" % number, and of namespace + "/odom", the last part: the rest is often a variable.
            texts = [
                part.value
                for part in ast.walk(call.args[0] if call.args else call.func)
                if isinstance(part, ast.Constant) and isinstance(part.value, str)
            ]
            last = re.split(r"[/~]", texts[-1])[-1] if texts else ""
            where = f"{path.name}:{call.lineno}: {last} is not in the README of {package}"
            assert not re.match(r"^\w+$", last) or last in known, where


def test_every_promise_names_a_test_that_exists():
    texts = [path.read_text(encoding="utf-8") for path in sources.list_python_files() if "test" in path.parts]
    defined = {name for text in texts for name in re.findall(r"^ *def (test_\w+)\(", text, re.MULTILINE)}
    for page in ("docs/reliability.md", "docs/security.md"):
        for name in TEST_NAME.findall((sources.ROOT / page).read_text(encoding="utf-8")):
            assert name in defined, f"{page} names {name}, which no file defines"


def test_every_function_that_stands_beside_its_file_is_in_it():
    shown = []
    for page in sources.list_files(".md"):
        text = page.read_text(encoding="utf-8")
        shown += [(page, *found) for found in re.findall(r"\]\(([\w/.]+\.py)\),\s+`(\w+)\(\)`", text)]
    assert shown
    for page, file, name in shown:
        code = (page.parent / file).read_text(encoding="utf-8")
        assert re.search(rf"^ *def {name}\(", code, re.MULTILINE), f"{page.name}: {file} defines no {name}()"


def test_the_api_page_shows_every_public_name_of_hero_client():
    outline = (sources.ROOT / "docs" / "site" / "api_outline.txt").read_text(encoding="utf-8")
    shown = re.findall(r"^(?:::: |### )([\w.]+)$", outline, re.MULTILINE)
    tree = sources.parse(sources.ROOT / "hero_client" / "src" / "hero_client" / "__init__.py")
    assigned = {node.targets[0].id: node.value for node in tree.body if isinstance(node, ast.Assign)}
    for module, names in ast.literal_eval(assigned["_NAMES"]).items():
        for name in names.split():
            assert {module, name, f"{module}.{name}"} & set(shown), f"api_outline.txt: no ::: {module}.{name}"


@pytest.mark.skipif(sys.version_info < (3, 9), reason="ast.unparse() is new in Python 3.9")
def test_the_api_page_is_what_the_sources_say():
    program = [sys.executable, str(sources.ROOT / "docs" / "site" / "api_page.py"), "--check"]
    assert subprocess.call(program) == 0, "docs/api.md is older than the sources: docs/site/api_page.py writes it"


def test_commands_parameters_and_topics_are_found_at_all():
    assert len(COMMANDS) > 100
    assert len(list(commands_of("roslaunch"))) > 20
    assert len([call for package in PACKAGES for call in calls_in(package, ("read_parameters",))]) >= 5
    assert len([call for package in PACKAGES for call in calls_in(package, ("Publisher", "Subscriber"))]) >= 15
