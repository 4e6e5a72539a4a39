"""Launch files and package.xml: well-formed, documented, naming files and nodes that exist."""

import re
import xml.etree.ElementTree as ElementTree

import pytest
import sources

LAUNCH_FILES = sources.list_files(".launch")
PACKAGES = sources.list_packages()


def name_of(path):
    return str(path.relative_to(sources.ROOT))


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=name_of)
def test_every_argument_is_documented(path):
    for argument in ElementTree.parse(path).getroot().findall("arg"):
        assert argument.get("doc"), f"{name_of(path)}: arg {argument.get('name')} has no doc"


def find_forwarded(path):
    """Return the launch file to which all arguments are passed on; None for a file that has nodes of its own."""
    for include in ElementTree.parse(path).getroot().findall("include"):
        if include.get("pass_all_args") == "true":
            package, file = re.fullmatch(r"\$\(find (\w+)\)/(.+)", include.get("file")).groups()
            return sources.ROOT / package / file
    return None


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=name_of)
def test_every_argument_is_in_the_readme_of_its_package(path):
    readme = (sources.ROOT / sources.package_of(path) / "README.md").read_text(encoding="utf-8")
    assert path.name in readme, f"{path.name} is not in the README of {sources.package_of(path)}"
    if find_forwarded(path):
        return
    for argument in ElementTree.parse(path).getroot().findall("arg"):
        name = argument.get("name")
        # `~name` where the argument is the node's parameter
        assert f"`{name}`" in readme or f"`~{name}`" in readme, f"{path.name}: `{name}` is missing"


@pytest.mark.parametrize("path", list(filter(find_forwarded, LAUNCH_FILES)), ids=name_of)
def test_a_launch_file_that_passes_arguments_on_declares_the_same(path):
    own, forwarded = (
        [argument.attrib for argument in ElementTree.parse(file).getroot().findall("arg")]
        for file in (path, find_forwarded(path))
    )
    assert own == forwarded, f"{name_of(path)}: arguments differ from those of {name_of(find_forwarded(path))}"


@pytest.mark.parametrize("path", LAUNCH_FILES + sources.list_files(".test"), ids=name_of)
def test_files_and_nodes_of_ours_that_it_names_exist(path):
    text = path.read_text(encoding="utf-8")
    for package, file in re.findall(r"\$\(find (hero_\w+)\)/([\w/.\-]+)", text):
        assert (sources.ROOT / package / file).exists(), f"{package}/{file}"
    for element in ElementTree.fromstring(text).iter():
        package, program = element.get("pkg"), element.get("type")
        if package in PACKAGES and program and "$" not in program:
            is_there = program in sources.list_programs(package) or any((sources.ROOT / package).rglob(program))
            assert is_there, f"{name_of(path)}: {package} has no {program}"


@pytest.mark.parametrize("path", LAUNCH_FILES, ids=name_of)
def test_every_node_says_where_its_output_goes_and_that_names_are_relative(path):
    for node in ElementTree.parse(path).getroot().iter("node"):
        assert node.get("output"), f"{name_of(path)}: node {node.get('name')}: output="
        assert not node.get("name").startswith("/"), f"{name_of(path)}: {node.get('name')}"


@pytest.mark.parametrize("package", PACKAGES)
def test_package_xml_is_of_format_3_and_like_the_others(package):
    root = ElementTree.parse(sources.ROOT / package / "package.xml").getroot()
    first = ElementTree.parse(sources.ROOT / PACKAGES[0] / "package.xml").getroot()
    assert root.get("format") == "3"
    assert root.findtext("name") == package
    assert root.findtext("license") == "BSD-3-Clause"
    assert root.findtext("version") == first.findtext("version"), "all packages carry one version"
    assert len(root.findtext("description").strip()) > 20
