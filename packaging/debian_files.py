"""Writes debian/ for the packages of the suite from their package.xml; source package ros-hero, one .deb per package.

Usage: debian_files.py SOURCES DEBIAN_DIR, with the packages below SOURCES. Source: Debian policy 4 and 5, debhelper(7).
"""

import sys
from email.utils import formatdate
from pathlib import Path
from subprocess import DEVNULL, call

from catkin_pkg.topological_order import topological_order

RECOMMENDED = {
    "rviz": "started only on request, and as large as everything else",
    "message_runtime": "for programs in C++, with all of their headers",
}

OTHER_PROGRAMS = {"tf"}  # of Debian, which are not the ROS package of this name

CONTROL = """\
Source: ros-hero
Section: misc
Priority: optional
Maintainer: {maintainer}
Build-Depends: debhelper-compat (= 13), dh-python, {build_depends}
Standards-Version: 4.5.1
Homepage: {homepage}
Rules-Requires-Root: no
"""

BINARY = """
Package: {name}
Architecture: all
Depends: {depends}
Recommends: {recommends}
Description: {description}
 Package {ros_name} of the HeRo suite for ROS.
"""

CHANGELOG = """\
ros-hero ({version}) unstable; urgency=medium

  * Version {version}; the packages' changes: CHANGELOG.rst.

 -- {maintainer}  {date}
"""

# cmake installs each package of the workspace for itself.
RULES = """\
#!/usr/bin/make -f
%:
\tdh $@ --sourcedirectory=src --buildsystem=cmake --with=python3
override_dh_auto_configure:
\tdh_auto_configure -- -DCATKIN_BUILD_BINARY_PACKAGE=ON -DCATKIN_ENABLE_TESTING=OFF -DPYTHON_EXECUTABLE=/usr/bin/python3
override_dh_auto_test:
override_dh_auto_install:
"""

INSTALL = "\tDESTDIR=$(CURDIR)/debian/{name} cmake -P obj-$(DEB_HOST_GNU_TYPE)/{ros_name}/cmake_install.cmake\n"


def make_name(ros_name):
    """Return the name of a package's .deb: ros-hero-driver of hero_driver."""
    return "ros-" + ros_name.replace("_", "-")


def find_debian_packages(key):
    """Return Debian's packages of a rosdep key: Python modules, messages and programs, each in a package of their own."""
    name = key.replace("_", "-")
    known = [
        candidate
        for candidate in (f"python3-{name}", f"ros-{name}", name)
        if candidate not in OTHER_PROGRAMS
        and call(["apt-cache", "show", candidate], stdout=DEVNULL, stderr=DEVNULL) == 0
    ]
    if not known:
        sys.exit(f"debian_files.py: Debian has no package for the dependency {key}")
    return known


def join_dependencies(keys, own, version):
    """Return the relationship field of these rosdep keys; own are the suite's packages."""
    names = []
    for key in sorted(keys):
        names += [f"{make_name(key)} (= {version})"] if key in own else find_debian_packages(key)
    return ", ".join(names)


def write_debian_dir(sources, directory):
    """Write control, changelog, rules and the copyright."""
    packages = [package for _, package in topological_order(str(sources))]
    own = {package.name for package in packages}
    first = packages[0]
    maintainer = f"{first.maintainers[0].name} <{first.maintainers[0].email}>"
    keys = {
        dependency.name
        for package in packages
        for dependency in package.buildtool_depends + package.build_depends
        if dependency.name not in own
    }
    control = CONTROL.format(
        maintainer=maintainer,
        build_depends=join_dependencies(keys, own, first.version),
        homepage=first.urls[0].url,
    )
    rules = RULES
    for package in packages:
        name = make_name(package.name)
        keys = {dependency.name for dependency in package.exec_depends}
        control += BINARY.format(
            name=name,
            ros_name=package.name,
            depends="${misc:Depends}, ${python3:Depends}, "
            + join_dependencies(keys - set(RECOMMENDED), own, package.version),
            recommends=join_dependencies(keys & set(RECOMMENDED), own, package.version),
            description=package.description.rstrip("."),
        )
        rules += INSTALL.format(name=name, ros_name=package.name)
        (directory / f"{name}.docs").write_text(f"src/{package.name}/CHANGELOG.rst\n")
    (directory / "control").write_text(control)
    (directory / "rules").write_text(rules)
    (directory / "rules").chmod(0o755)
    (directory / "changelog").write_text(
        CHANGELOG.format(version=first.version, maintainer=maintainer, date=formatdate(localtime=True))
    )


if __name__ == "__main__":
    write_debian_dir(*map(Path, sys.argv[1:]))
