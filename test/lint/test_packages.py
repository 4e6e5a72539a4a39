"""package.xml, CHANGELOG.rst and launch files: complete, alike, and true to what the sources use."""

import ast
import re
import sys
import xml.etree.ElementTree as ElementTree

import pytest
import yaml
from catkin_pkg.changelog import get_changelog_from_path
from catkin_pkg.package_version import get_forthcoming_label

import sources

PACKAGES = sources.PACKAGES
LAUNCH_FILES = sources.list_files(".launch")
STANDARD_LIBRARY = getattr(sys, "stdlib_module_names", None)

# The packages from the ground up: each depends only on packages before it, whatever its tests use.
ORDER = (
    "hero_msgs",
    "hero_node",
    "hero_test",
    "hero_driver",
    "hero_client",
    "hero_sim",
    "hero_common",
    "hero_description",
    "hero_tools",
    "hero_monitor",
    "hero_recording",
    "hero_calibration",
    "hero_localization",
    "hero_swarm",
    "hero_examples",
    "hero_bringup",
    "hero_tutorial",
    "hero_options",
    "hero",
)
METAPACKAGES = ("hero", "hero_options")
FOR_LEARNING = {"hero_examples", "hero_tutorial"}
KNOW_NEITHER_DRIVER_NOR_SIMULATOR = {"hero_client", "hero_examples", "hero_tutorial", "hero_description"}

CONDA_NAMES = {"catkin-pkg": "catkin_pkg", "matplotlib": "matplotlib-base", "pil": "pillow", "yaml": "pyyaml"}


def name_in_conda(key):
    """Return what conda-forge or RoboStack call the package of a rosdep key."""
    if key.startswith("python3-"):
        name = key[len("python3-") :]
        return CONDA_NAMES.get(name, name)
    return "ros-noetic-" + key.replace("_", "-")


def needed_package(module, own_package):
    """The package that must be declared for an import, or None for the standard library and for our own."""
    top = module.split(".")[0]
    if top in (own_package, "__future__"):
        return None
    if top.endswith("_msgs") or top in PACKAGES:
        return top
    return sources.OTHER_PACKAGES.get(top)


def find_needs(package, in_tests):
    """Return the packages that the Python sources of a package import, each with one place."""
    needs = {}
    for path in sources.list_python_files():
        if sources.package_of(path) != package or path.name == "setup.py":
            continue
        if ("test" in path.relative_to(PACKAGES[package]).parts) == in_tests:
            for found in sources.read_imports(path):
                needed = needed_package(found.module, package)
                if needed:
                    needs.setdefault(needed, f"{sources.name_of(path)}:{found.line}")
    build = PACKAGES[package] / "CMakeLists.txt"
    for page, name in re.findall(r"hero_add_page_script\((\S+) (\w+\.py)", build.read_text(encoding="utf-8")):
        text = (build.parent / page).read_text(encoding="utf-8")
        (script,) = re.findall(f"/scripts/{name} -->\n```python\n(.*?)```", text, re.DOTALL)
        for module in re.findall(r"^(?:import|from) (\S+)", script, re.MULTILINE) if not in_tests else ():
            needed = needed_package(module, package)
            if needed:
                needs.setdefault(needed, page)
    if not in_tests and re.search(r"^hero_add_(node|page_script)\(", build.read_text(encoding="utf-8"), re.MULTILINE):
        needs.setdefault("hero_node", sources.name_of(build))  # reads their arguments
    return needs


def find_launch_needs(package):
    """Return the packages that the launch files of a package take nodes or files from."""
    needs = {}
    for path in LAUNCH_FILES:
        if sources.package_of(path) == package:
            text = path.read_text(encoding="utf-8")
            names = {node.get("pkg") for node in ElementTree.fromstring(text).iter() if node.get("pkg")}
            for name in names | set(re.findall(r"\$\(find (\w+)\)", text)) - {package}:
                if "$" not in name and name != package:
                    needs[name] = sources.name_of(path)
    return needs


def test_every_package_xml_is_complete_and_like_the_others():
    versions = set()
    for package in PACKAGES:
        root = ElementTree.parse(PACKAGES[package] / "package.xml").getroot()
        versions.add(root.findtext("version"))
        assert root.get("format") == "3", package
        assert root.findtext("name") == package
        assert root.findtext("license") == "BSD-3-Clause", package
        assert root.find("author") is not None, package
        assert root.find("export/architecture_independent") is not None, f"{package}: nothing is compiled"
    assert len(versions) == 1, "all packages carry one version"


def test_every_package_finds_alone_the_functions_that_build_it():
    """In one workspace of catkin_make, functions that another package has found are there for all."""
    for package in ORDER[1:-2]:  # but hero_msgs and the metapackages
        build = (PACKAGES[package] / "CMakeLists.txt").read_text(encoding="utf-8")
        (components,) = re.findall(r"^find_package\(catkin REQUIRED COMPONENTS (.*)\)$", build, re.MULTILINE)
        has_messages = "generate_messages(" in build
        assert components.split() == ["hero_msgs", *["message_generation"] * has_messages], package
        root = ElementTree.parse(PACKAGES[package] / "package.xml").getroot()
        needed = {found.text for kind in ("build_depend", "depend") for found in root.iter(kind)}
        assert set(components.split()) <= needed, package


def test_every_package_has_a_changelog_of_its_version():
    for package in PACKAGES:
        changelog = get_changelog_from_path(str(PACKAGES[package]), package)
        assert changelog, f"{package} has no CHANGELOG.rst"
        version = ElementTree.parse(PACKAGES[package] / "package.xml").getroot().findtext("version")
        versions = [found for found, _, _ in changelog.foreach_version()]
        assert version in versions or get_forthcoming_label(changelog.rst), f"{package}: nothing about {version}"


def test_every_package_has_a_readme_that_begins_with_its_name():
    for package in PACKAGES:
        assert (PACKAGES[package] / "README.md").read_text(encoding="utf-8").startswith(f"# {package}\n")


def test_packages_depend_only_on_packages_below_them():
    assert sorted(ORDER) == sorted(PACKAGES)
    for package in PACKAGES:
        depends = set(sources.read_dependencies(package, "depend", "build_depend", "exec_depend")) & set(PACKAGES)
        above = depends - set(ORDER[: ORDER.index(package)])
        assert not above, f"{package} depends on {above}"
        if package not in (*FOR_LEARNING, "hero_bringup", *METAPACKAGES):
            assert not depends & FOR_LEARNING, f"{package} depends on {depends & FOR_LEARNING}"
        if package in KNOW_NEITHER_DRIVER_NOR_SIMULATOR:
            assert not depends & {"hero_driver", "hero_sim"}, f"{package} knows topics only"


def test_every_import_and_launched_node_is_declared():
    missing = []
    for package in PACKAGES:
        declared = set(sources.read_dependencies(package, "depend", "exec_depend"))
        needs = {**find_launch_needs(package), **find_needs(package, in_tests=False)}
        missing += [f"{package}: exec_depend {name} ({where})" for name, where in needs.items() if name not in declared]
        declared = set(sources.read_dependencies(package))
        needs = find_needs(package, in_tests=True)
        missing += [f"{package}: test_depend {name} ({where})" for name, where in needs.items() if name not in declared]
    assert not missing, missing


def test_every_declared_dependency_of_ours_or_of_ros_is_used():
    checkable = {*PACKAGES, *sources.OTHER_PACKAGES.values()} - {"roslaunch", "rostest"}  # hero_add_tests() uses these
    for package in PACKAGES:
        used = {**find_needs(package, in_tests=False), **find_needs(package, in_tests=True)}
        suffixes = (".launch", ".test", ".msg", ".srv", ".action", ".py", "CMakeLists.txt")
        paths = [path for path in sources.list_files(*suffixes) if sources.package_of(path) == package]
        text = "\n".join(path.read_text(encoding="utf-8") for path in paths)
        for name in sources.read_dependencies(package, "depend", "exec_depend", "test_depend"):
            if package not in METAPACKAGES and (name in checkable or name.endswith("_msgs")):
                assert name in used or re.search(rf"\b{name}\b", text), f"{package} declares {name} for nothing"


@pytest.mark.skipif(STANDARD_LIBRARY is None, reason="needs Python 3.10")
def test_only_known_libraries_are_imported():
    for path in sources.list_source_modules().values():
        package = sources.package_of(path)
        for found in sources.read_imports(path):
            known = found.top in STANDARD_LIBRARY | sources.WITHOUT_ROSDEP_KEY | {package}
            known = known or needed_package(found.module, package)
            assert known, f"{path}:{found.line}: {found.module}: tell test/sources.py which package it is in"


def test_every_dependency_is_a_known_rosdep_key():
    files = yaml.safe_load((sources.ROOT / "test" / "lint" / "rosdep_keys.yaml").read_text(encoding="utf-8"))
    keys = {key for listed in files.values() for key in listed}
    needed = {name for package in PACKAGES for name in sources.read_dependencies(package)} - set(PACKAGES)
    assert needed == keys, f"not looked up: {needed - keys}; of no package: {keys - needed}"


def test_the_recipe_of_robostack_has_the_version_and_dependencies_of_all():
    recipe = yaml.safe_load((sources.ROOT / "packaging" / "robostack" / "recipe.yaml").read_text(encoding="utf-8"))
    version = ElementTree.parse(sources.ROOT / "hero" / "package.xml").getroot().findtext("version")
    assert recipe["context"]["version"] == version
    kinds = {"host": ("depend", "build_depend", "buildtool_depend"), "run": ("depend", "exec_depend")}
    for part, tags in kinds.items():
        keys = {name for package in PACKAGES for name in sources.read_dependencies(package, *tags)} - set(PACKAGES)
        assert {name_in_conda(key) for key in keys} | {"python"} == set(recipe["requirements"][part])


def test_bootstrap_installs_the_python_packages_that_are_declared():
    listed = (sources.ROOT / "script" / "bootstrap").read_text(encoding="utf-8").split()
    for package in PACKAGES:
        for name in sources.read_dependencies(package):
            assert not name.startswith("python3-") or name in listed, f"{name}: add to SUITE_PACKAGES"


def test_every_program_has_a_module_with_a_main():
    for package in PACKAGES:
        text = sources.read_cmake(package)
        for name, module in re.findall(r"hero_add_(?:program|node)\((\w+) ?([\w.]*)\)", text):
            path = PACKAGES[package] / "src" / package / f"{(module or name).replace('.', '/')}.py"
            functions = [node for node in ast.parse(path.read_text()).body if isinstance(node, ast.FunctionDef)]
            assert "main" in [function.name for function in functions], f"{package}: {name}"


def find_forwarded(path):
    """Return the launch file to which all arguments are passed on; None for a file that has nodes of its own."""
    for include in ElementTree.parse(path).getroot().findall("include"):
        if include.get("pass_all_args") == "true":
            package, file = re.fullmatch(r"\$\(find (\w+)\)/(.+)", include.get("file")).groups()
            return PACKAGES[package] / file
    return None


def read_arguments(path):
    """Return the attributes of each argument that users may set: those with a value are fixed."""
    arguments = [argument.attrib for argument in ElementTree.parse(path).getroot().findall("arg")]
    return [argument for argument in arguments if "value" not in argument]


def test_launch_arguments_are_documented_there_and_in_the_readme():
    for path in LAUNCH_FILES:
        readme = (PACKAGES[sources.package_of(path)] / "README.md").read_text(encoding="utf-8")
        assert path.name in readme, f"{path.name} is not in the README of {sources.package_of(path)}"
        forwarded = find_forwarded(path)
        if forwarded:
            same = read_arguments(path) == read_arguments(forwarded)
            assert same, f"{sources.name_of(path)}: not the arguments that it passes on"
            continue
        for argument in read_arguments(path):
            name = argument["name"]
            assert argument.get("doc"), f"{path.name}: {name} has no doc"
            # `~name` where the argument is the node's parameter
            assert f"`{name}`" in readme or f"`~{name}`" in readme, f"{path.name}: no `{name}` in the README"


def find_parameters(package, program):
    """Return the names of the parameters that a program reads; none if these are not written where it begins."""
    folder = PACKAGES[package] / "src" / package if package in PACKAGES else None
    path = next(folder.rglob(f"{program}.py"), None) if folder else None
    if path is None:
        return set()
    calls = [node for node in sources.walk(path) if isinstance(node, ast.Call)]
    tables = [call.args[0] for call in calls if getattr(call.func, "id", "") == "read_parameters"]
    return {key.value for table in tables for key in getattr(table, "keys", []) if isinstance(key, ast.Constant)}


def test_launch_files_set_exactly_the_parameters_that_programs_read():
    found = 0
    for path in LAUNCH_FILES:
        arguments = {argument["name"] for argument in read_arguments(path)}
        for node in ElementTree.parse(path).getroot().iter("node"):
            read = find_parameters(node.get("pkg"), node.get("type"))
            if read and path.stem == node.get("type"):
                found += 1
                entries = [*node.iter("param"), *node.iter("rosparam")]
                given = {entry.get("name") or entry.get("param") for entry in entries} - {None}
                assert given == read, f"{sources.name_of(path)}: {given ^ read}"
                assert read <= arguments, f"{sources.name_of(path)}: no argument {read - arguments}"
    assert found > 5


def test_what_has_the_name_of_a_launch_argument_has_its_value():
    others = {("hero_description", "robots", "simulated")}  # of the node that shows true poses
    for path in LAUNCH_FILES:
        root = ElementTree.parse(path).getroot()
        names = {argument.get("name") for argument in root.findall("arg")}
        for entry in (*root.iter("param"), *root.iter("arg")):
            given = re.fullmatch(r"\$\(arg (\w+)\)", entry.get("value", ""))
            name = entry.get("name")
            if given and name in names - {given[1]}:
                assert (sources.package_of(path), name, given[1]) in others, f"{sources.name_of(path)}: {name}"


def test_launched_nodes_say_where_their_output_goes():
    for path in LAUNCH_FILES:
        for node in ElementTree.parse(path).getroot().iter("node"):
            assert node.get("output"), f"{sources.name_of(path)}: node {node.get('name')}: output="
            assert not node.get("name").startswith("/"), f"{sources.name_of(path)}: {node.get('name')}"
