"""What lies in this repository (packages, modules, imports), for the tests of its rules. Changes nothing.

Run as a program it prints the modules that script/lint gives to mypy: `strict` before those of packages that users run,
`others` before those of tests.
"""

import ast
import gc
import re
import subprocess
import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from pathlib import Path
from typing import Dict, List, NamedTuple

ROOT = Path(__file__).resolve().parents[1]

gc.disable()  # it would look through all syntax trees again and again, of which none is garbage

ROS_MODULES = (
    "actionlib angles diagnostic_updater genpy rosbag rosgraph roslaunch roslib rosnode rospy rosservice rostest"
    " rostopic rosunit std_srvs tf tf2_ros"
).split()
OTHER_PACKAGES = {
    # module that is imported: package to declare
    **{name: name for name in ROS_MODULES},
    "catkin_pkg": "python3-catkin-pkg",
    "cv2": "python3-opencv",
    "PIL": "python3-pil",
    **{name: f"python3-{name}" for name in "matplotlib numpy pexpect rospkg scipy selenium tornado tqdm yaml".split()},
}

WITHOUT_ROSDEP_KEY = {"apriltag", "distributed", "gymnasium", "pettingzoo", "qrcode"}
"""Optional modules: no package.xml can name them."""


class Import(NamedTuple):
    """One import statement: the full name of the module, e.g. hero_driver.rosserial.packets, and where."""

    module: str
    line: int

    @property
    def top(self):
        return self.module.split(".")[0]


@lru_cache(maxsize=None)
def list_files(*suffixes: str) -> List[Path]:
    """Files of the repository that git knows or would add, that exist, and end as given."""
    command = ["git", "-C", str(ROOT), "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    try:
        listed = subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout.decode().split("\0")
        paths = [ROOT / name for name in listed if name]
    except (OSError, subprocess.CalledProcessError):  # not a clone: an unpacked archive
        paths = [path for path in ROOT.rglob("*") if ".work" not in path.parts and ".git" not in path.parts]
    return sorted({path for path in paths if path.is_file() and str(path).endswith(suffixes or ("",))})


def find(pattern: str) -> List[Path]:
    """Paths that match in the folders of the packages: those of the core, of the options, and of the tests."""
    return sorted(path for place in (ROOT, ROOT / "options", ROOT / "test") for path in place.glob(f"hero*/{pattern}"))


PACKAGES: Dict[str, Path] = {path.parent.name: path.parent for path in find("package.xml")}
"""Folders of the catkin packages, which are called as they are."""


def list_programs(package: str) -> List[str]:
    """Programs of a package that rosrun finds: those that CMake makes, and scripts on pages."""
    scripts = re.findall(r"hero_add_page_script\(\S+ (\w+\.py)", read_cmake(package))
    return re.findall(r"hero_add_(?:program|node)\((\w+)", read_cmake(package)) + scripts


@lru_cache(maxsize=None)
def list_python_files() -> List[Path]:
    """Python modules and the scripts without extension."""
    return [path for path in list_files() if path.suffix == ".py" or is_python_script(path)]


def is_python_script(path: Path) -> bool:
    if path.suffix:
        return False
    with open(path, "rb") as file:
        first_line = file.readline()
    return first_line.startswith(b"#!") and b"python" in first_line


def name_of(path: Path) -> str:
    """The path of a file within the repository."""
    return str(path.relative_to(ROOT))


@lru_cache(maxsize=None)
def parse(path: Path) -> ast.Module:
    """The syntax tree of a Python file."""
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


@lru_cache(maxsize=None)
def walk(path: Path) -> List[ast.AST]:
    """All nodes of a Python file."""
    return list(ast.walk(parse(path)))


def read_cmake(package: str) -> str:
    """CMakeLists.txt of a package."""
    text = (PACKAGES[package] / "CMakeLists.txt").read_text(encoding="utf-8")
    return text.replace("${PROJECT_NAME}", package)


@lru_cache(maxsize=None)
def package_of(path: Path) -> str:
    """The catkin package that a file belongs to, or the top directory's name."""
    own = [folder.name for folder in path.parents if PACKAGES.get(folder.name) == folder]
    return own[0] if own else path.relative_to(ROOT).parts[0]


def module_name(path: Path) -> str:
    """The name by which a file below <package>/src is imported."""
    parts = list(path.relative_to(PACKAGES[package_of(path)] / "src").with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@lru_cache(maxsize=None)
def read_imports(path: Path) -> List[Import]:
    """All imports of a file, wherever they stand in it; relative ones resolved."""
    imports = []
    for node in walk(path):
        if isinstance(node, ast.Import):
            imports += [Import(alias.name, node.lineno) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                package = module_name(path).split(".")
                if path.name != "__init__.py":
                    package = package[:-1]
                package = package[: len(package) - node.level + 1]
                base = ".".join(package + ([base] if base else []))
            imports.append(Import(base, node.lineno))
            # `from .rosserial import packets` names a module too
            imports += [Import(f"{base}.{alias.name}", node.lineno) for alias in node.names]
    return imports


@lru_cache(maxsize=None)
def list_source_modules() -> Dict[str, Path]:
    """Modules below every <package>/src by their names."""
    return {
        module_name(path): path
        for path in list_python_files()
        if path.suffix == ".py" and PACKAGES.get(package_of(path), ROOT) / "src" in path.parents
    }


def is_ros_import(module: str) -> bool:
    top = module.split(".")[0]
    return top in ROS_MODULES or top.endswith("_msgs")


def list_pure_modules() -> List[Path]:
    """Modules below src/, without hero_test, that import nothing of ROS, directly or through others of ours."""
    modules = {name: path for name, path in list_source_modules().items() if package_of(path) != "hero_test"}
    imports = {name: {found.module for found in read_imports(path)} for name, path in modules.items()}
    impure = {name for name, imported in imports.items() if any(map(is_ros_import, imported))}
    while True:
        infected = {name for name, imported in imports.items() if name not in impure and imported & impure}
        if not infected:
            return [path for name, path in sorted(modules.items()) if name not in impure]
        impure |= infected


def read_dependencies(package: str, *kinds: str) -> List[str]:
    """What package.xml of a package declares, of the given kinds (exec_depend, ...), or of every kind."""
    root = ElementTree.parse(PACKAGES[package] / "package.xml").getroot()
    tags = kinds or ("depend", "build_depend", "buildtool_depend", "exec_depend", "test_depend")
    return [element.text.strip() for tag in tags for element in root.findall(tag)]


if __name__ == "__main__":
    for checked in sorted(list_source_modules().values()):
        print("others" if package_of(checked) == "hero_test" else "strict", checked.relative_to(ROOT))
