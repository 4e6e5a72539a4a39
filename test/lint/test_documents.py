"""Markdown files: every link leads somewhere, every command names scripts, programs, files and options that exist."""

import re
import xml.etree.ElementTree as ElementTree
from functools import lru_cache

import documents
import pytest
import sources

PAGES = sources.list_files(".md")
PACKAGES = sources.list_packages()
COMMANDS = [command for page in PAGES for command in documents.read_commands(page)]
# Begin no command but stand before one.
PREFIXES = ("sudo", "time", "timeout", "env", "exec", "nohup", "do", "then")
NAMES_OF_ROS = {"/tf", "/tf_static", "/rosout", "/rosout_agg", "/diagnostics", "/clock", "/joy", "/odom"}
TALKS_ABOUT_NAMES = {
    "rostopic": ("echo", "hz", "bw", "info", "pub", "delay"),
    "rosservice": ("call", "info", "args", "type"),
}


def name_of(path):
    return str(path.relative_to(sources.ROOT))


def strip_prefixes(words):
    while words and (
        words[0] in PREFIXES or re.match(r"^[A-Z_]+=", words[0]) or re.match(r"^[\d.]+s?$", words[0])
    ):
        words = words[1:]
    return words


def commands_of(*programs):
    """Commands that start one of the programs, as parameters of a test."""
    found = []
    for command in COMMANDS:
        words = strip_prefixes(command.words)
        if words and words[0] in programs:
            found.append(pytest.param(words, id=str(command)))
    return found


@lru_cache(maxsize=None)
def read_arguments(package, name):
    """Names of the arguments of a launch file, or None if there is no such file."""
    places = [
        path
        for path in sources.list_files(".launch")
        if path.name == name and sources.package_of(path) == package
    ]
    if not places:
        return None
    return {argument.get("name") for argument in ElementTree.parse(places[0]).getroot().findall("arg")}


@lru_cache(maxsize=None)
def read_package_text(package):
    """All of the Python sources of a package."""
    files = [path for path in sources.list_python_files() if sources.package_of(path) == package]
    return "\n".join(path.read_text(encoding="utf-8") for path in files if "test" not in path.parts)


def has_option(text, option):
    """Whether a program's text names the option; --help is everybody's."""
    return option == "--help" or f'"{option}"' in text


def documented_names():
    """Names of topics and services that the READMEs of the packages list, with N for a robot's number."""
    names = set(NAMES_OF_ROS)
    for package in PACKAGES:
        for line in documents.read_lines(sources.ROOT / package / "README.md"):
            names |= {word for word in documents.INLINE.findall(line.text) if re.match(r"^/[\w/]+$", word)}
            if package == "hero_driver":
                names |= {
                    "/hero_driver/" + word[1:]
                    for word in documents.INLINE.findall(line.text)
                    if re.match(r"^~\w+$", word)
                }
    return names


DOCUMENTED_NAMES = documented_names()


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_link_leads_to_a_file_and_a_heading_that_exist(page):
    for target in documents.read_links(page):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        place = page.parent / file if file else page
        assert place.is_file(), f"{name_of(page)}: {target}: no such file"
        if anchor:
            assert anchor in documents.read_anchors(place), f"{name_of(page)}: {target}: no such heading"


@pytest.mark.parametrize("words", commands_of("roslaunch"))
def test_every_roslaunch_names_a_launch_file_and_its_arguments(words):
    plain = [word for word in words[1:] if not word.startswith("-")]
    if "-p" in words:
        plain.remove(words[words.index("-p") + 1])
    if not plain or plain[0] not in PACKAGES:
        assert not plain or not plain[0].startswith("hero_"), f"there is no package {plain[0]}"
        return
    package, file, *arguments = [*plain, ""][:2] + plain[2:]
    known = read_arguments(package, file)
    assert known is not None, f"{package} has no launch/{file}"
    for argument in arguments:
        name, given, _ = argument.partition(":=")
        if given:
            assert name in known, f"{file} has no argument {name}"


@pytest.mark.parametrize("words", commands_of("rosrun"))
def test_every_rosrun_names_a_program_and_its_options(words):
    package, program, *arguments = [*words[1:], "", ""][: max(2, len(words) - 1)]
    if package not in PACKAGES:
        assert not package.startswith("hero_"), f"there is no package {package}"
        return
    assert program in sources.list_programs(package), f"{package} has no program {program}"
    for argument in arguments:
        option = re.match(r"^(--[\w-]+)", argument)
        if option:
            assert has_option(read_package_text(package), option.group(1)), (
                f"{program} has no option {option.group(1)}"
            )
        parameter = re.match(r"^_(\w+):=", argument)
        if parameter and not argument.startswith("__"):
            assert re.search(rf"\b{parameter.group(1)}\b", read_package_text(package)), (
                f"no parameter {argument}"
            )


@pytest.mark.parametrize("words", commands_of("rostest"))
def test_every_rostest_exists(words):
    if len(words) > 2 and words[1] in PACKAGES:
        assert (sources.ROOT / words[1] / "test" / "rostest" / words[2]).is_file()


@pytest.mark.parametrize(
    "words",
    [
        pytest.param(strip_prefixes(command.words), id=str(command))
        for command in COMMANDS
        if strip_prefixes(command.words)
        and re.match(r"^(\S*/)?script/\w+$", strip_prefixes(command.words)[0])
    ],
)
def test_every_script_and_its_options_exist(words):
    path = sources.ROOT / "script" / words[0].split("/")[-1]
    assert path.is_file(), f"there is no script/{path.name}"
    text = path.read_text(encoding="utf-8")
    programs = re.findall(r"[\w/]+\.py", text) + [f"bench/{word}_bench.py" for word in words[1:]]
    text += "".join((sources.ROOT / name).read_text() for name in programs if (sources.ROOT / name).is_file())
    for word in words[1:]:
        option = re.match(r"^(--[\w-]+)", word)
        assert not option or option.group(1) in text, f"script/{path.name} has no option {option.group(1)}"


@pytest.mark.parametrize("words", commands_of(*TALKS_ABOUT_NAMES))
def test_every_topic_and_service_that_is_asked_for_is_in_a_readme(words):
    if len(words) < 3 or words[1] not in TALKS_ABOUT_NAMES[words[0]]:
        return
    names = [word for word in words[2:] if word.startswith("/")][:1]
    for name in names:
        plain = re.sub(r"/hero_(\d+|N|\$\{?\w+\}?)(?=/|$)", "/hero_N", name)
        plain = re.sub(r"^/hero_driver_\w+", "/hero_driver", plain)  # one of several drivers
        assert "$" in plain or any(
            plain == known or plain.startswith(known + "/") for known in DOCUMENTED_NAMES
        ), f"no README of a package lists {name}"


@pytest.mark.parametrize("words", commands_of("rosmsg", "rossrv"))
def test_every_type_that_is_shown_exists(words):
    folder = {"rosmsg": "msg", "rossrv": "srv"}[words[0]]
    for word in words[1:]:
        package, _, kind = word.partition("/")
        if package in PACKAGES and kind:
            assert (sources.ROOT / package / folder / f"{kind}.{folder}").is_file(), word


@pytest.mark.parametrize("words", [found for found in commands_of("python3") if "-m" in found.values[0]])
def test_every_module_that_is_run_exists_with_its_options(words):
    module = words[words.index("-m") + 1]
    if module not in PACKAGES:
        return
    for word in words:
        option = re.match(r"^(--[\w-]+)", word)
        assert not option or has_option(read_package_text(module), option.group(1)), (
            f"{module} has no option {word}"
        )


@pytest.mark.parametrize("package", PACKAGES)
def test_every_option_of_a_program_is_in_the_readme_of_its_package(package):
    readme = (sources.ROOT / package / "README.md").read_text(encoding="utf-8")
    sources_below = [
        path for path in sources.list_source_modules().values() if sources.package_of(path) == package
    ]
    text = "\n".join(path.read_text(encoding="utf-8") for path in sources_below)
    options = set(re.findall(r'add_argument\(\s*"(--[\w-]+)"', text))
    # Or as the argument of a launch file of the same name.
    missing = sorted(
        option
        for option in options
        if not re.search(rf"`{option}\b", readme) and f"`{option[2:].replace('-', '_')}`" not in readme
    )
    assert not missing, f"not in the README of {package}: {missing}"


def test_commands_are_found_at_all():
    assert len(COMMANDS) > 100
    assert len(commands_of("roslaunch")) > 20
