"""What the sources use stands in package.xml, and the other way round (catkin_lint does not read Python)."""

import re
import sys
import xml.etree.ElementTree as ElementTree

import pytest
import sources

PACKAGES = sources.list_packages()
RUN = ("depend", "exec_depend")
TEST = (*RUN, "test_depend", "build_depend", "buildtool_depend")
STANDARD_LIBRARY = getattr(sys, "stdlib_module_names", None)
# Used in tests only; script/bootstrap installs them, no package needs them to run.
TEST_TOOLS = {"pytest", "hypothesis", "selenium"}


def needed_package(module, own_package):
    """The package that must be declared for an import, or None for the standard library and for our own."""
    top = module.split(".")[0]
    if top in (own_package, "__future__"):
        return None
    if top in sources.ROS_MODULES:
        return sources.ROS_MODULES[top]
    if top in sources.OTHER_MODULES:
        return sources.OTHER_MODULES[top]
    if top.endswith("_msgs") or top in PACKAGES:
        return top
    return None


def read_cmake(package):
    text = (sources.ROOT / package / "CMakeLists.txt").read_text(encoding="utf-8")
    return text.replace("${PROJECT_NAME}", package)


def python_files(package, in_tests):
    for path in sources.list_python_files():
        parts = path.relative_to(sources.ROOT).parts
        if parts[0] == package and path.name != "setup.py" and ("test" in parts) == in_tests:
            yield path


def launch_packages(path):
    """Packages that a launch file takes nodes or files from."""
    text = path.read_text(encoding="utf-8")
    found = {element.get("pkg") for element in ElementTree.fromstring(text).iter() if element.get("pkg")}
    return {name for name in found | set(re.findall(r"\$\(find (\w+)\)", text)) if "$" not in name}


@pytest.mark.parametrize("package", PACKAGES)
def test_every_import_and_launched_node_is_declared(package):
    declared = set(sources.read_dependencies(package, *RUN))
    missing = {}
    for path in python_files(package, in_tests=False):
        for found in sources.read_imports(path):
            needed = needed_package(found.module, package)
            if needed and needed not in declared:
                missing.setdefault(needed, f"{path.relative_to(sources.ROOT)}:{found.line}")
    for path in sources.list_files(".launch"):
        if path.relative_to(sources.ROOT).parts[:2] == (package, "launch"):
            for needed in launch_packages(path) - declared - {package}:
                missing.setdefault(needed, str(path.relative_to(sources.ROOT)))
    assert not missing, f"add to {package}/package.xml as <exec_depend>: {missing}"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_import_of_a_test_is_declared(package):
    declared = set(sources.read_dependencies(package, *TEST))
    missing = {}
    for path in python_files(package, in_tests=True):
        for found in sources.read_imports(path):
            needed = needed_package(found.module, package)
            if needed and needed not in declared:
                missing.setdefault(needed, f"{path.relative_to(sources.ROOT)}:{found.line}")
    assert not missing, f"add to {package}/package.xml as <test_depend>: {missing}"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_declared_python_dependency_is_used(package):
    used = set()
    for in_tests in (False, True):
        for path in python_files(package, in_tests):
            used |= {needed_package(found.module, package) for found in sources.read_imports(path)}
    for path in sources.list_files(".launch", ".test", ".msg", ".srv", ".action", "CMakeLists.txt"):
        if sources.package_of(path) == package:
            text = path.read_text(encoding="utf-8")
            used |= {name for name in sources.read_dependencies(package) if re.search(rf"\b{name}\b", text)}
    declared = set(sources.read_dependencies(package, "exec_depend", "depend"))
    checkable = {name for name in declared if name in PACKAGES or name in set(sources.ROS_MODULES.values())}
    checkable |= {name for name in declared if name.endswith("_msgs")}
    assert checkable <= used, f"declared in {package}/package.xml but not used: {sorted(checkable - used)}"


@pytest.mark.skipif(STANDARD_LIBRARY is None, reason="needs Python 3.10")
@pytest.mark.parametrize("path", sources.list_source_modules().values(), ids=str)
def test_only_known_libraries_are_imported(path):
    package = sources.package_of(path)
    for found in sources.read_imports(path):
        known = found.top in STANDARD_LIBRARY or found.top == package or needed_package(found.module, package)
        assert known, f"{path}:{found.line}: {found.module}: tell test/lint/sources.py which package it is in"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_directory_that_nodes_read_is_installed(package):
    text = read_cmake(package)
    installed = " ".join(re.findall(r"install\(\s*DIRECTORY([^)]*)\)", text)).split()
    for name in ("config", "launch", "rviz", "urdf", "meshes", "worlds", "arenas"):
        directory = sources.ROOT / package / name
        if directory.is_dir() and any(directory.iterdir()):
            assert name in installed, f"install(DIRECTORY {name} ...) in {package}/CMakeLists.txt"


@pytest.mark.parametrize("package", PACKAGES)
def test_bootstrap_installs_the_debian_packages_that_are_declared(package):
    listed = (sources.ROOT / "script" / "bootstrap").read_text(encoding="utf-8").split()
    missing = [
        name
        for name in sources.read_dependencies(package)
        if name.startswith("python3-") and name not in listed
    ]
    assert not missing, f"add to DEBIAN_PACKAGES in script/bootstrap: {missing}"
