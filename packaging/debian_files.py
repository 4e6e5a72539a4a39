"""Writes debian/ for the packages of the suite from their package.xml; source package ros-hero, one .deb per package.

Usage: debian_files.py SOURCES DEBIAN_DIR [BUILD], with the packages below SOURCES; BUILD, such as 20261126.412, is
added to their version. Source: Debian policy 4 and 5, debhelper(7), systemd.service(5).
"""

import sys
from email.utils import formatdate
from functools import lru_cache
from pathlib import Path
from subprocess import check_output

from catkin_pkg.topological_order import topological_order

RECOMMENDED = {
    "rviz": "started only on request, and as large as everything else",
    "python3-opencv": "for the overhead camera only, and as large",
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
CMAKE_OPTIONS = (
    "-DCATKIN_BUILD_BINARY_PACKAGE=ON",
    "-DCATKIN_ENABLE_TESTING=OFF",
    "-DPYTHON_EXECUTABLE=/usr/bin/python3",
    "-DPython_EXECUTABLE=/usr/bin/python3",  # Debian 13's catkin takes this name only
)
SERVICES = {
    # name: what it is, what it starts
    "hero-master": ("ROS master of the robots", "roscore"),
    "hero-driver": ("driver of the robots", "roslaunch --wait hero_bringup hero_bringup.launch $HERO_DRIVER"),
    "hero-monitor": ("monitor of the robots", "roslaunch --wait hero_bringup monitor.launch $HERO_MONITOR"),
    "hero-camera": ("overhead camera", "roslaunch --wait hero_bringup overhead_camera.launch $HERO_CAMERA"),
    "hero-recorder": ("recorder of the robots", "roslaunch --wait hero_bringup record.launch $HERO_RECORDER"),
}
"""Each for a user: systemctl enable --now hero-driver@USER; none is enabled by the packages."""

SERVICE = """\
[Unit]
Description=HeRo: {description} (of %i)
After=network-online.target {after}
Wants=network-online.target {after}

[Service]
User=%i
EnvironmentFile=-/etc/default/hero
ExecStart=/usr/bin/{command}
# roslaunch passes Ctrl-C on, at which the driver stops the robots.
KillMode=mixed
KillSignal=SIGINT
TimeoutStopSec=20
Restart=on-failure
RestartSec=2

[Install]
WantedBy=multi-user.target
"""

ENVIRONMENT = """\
# Read by the services hero-*@USER (docs/lab.md), as systemd reads it: NAME=VALUE, no $(...).
PYTHONUNBUFFERED=1
#ROS_MASTER_URI=http://192.168.1.10:11311
#ROS_IP=192.168.1.10
# Arguments of their launch files:
HERO_DRIVER=
HERO_MONITOR=
HERO_CAMERA=
HERO_RECORDER=
"""
SERVICES_PACKAGE = "ros-hero-bringup"

INSTALL_SERVICES = "".join(
    f"\tdh_installsystemd -p{SERVICES_PACKAGE} --name={name}@ --no-enable --no-start\n" for name in SERVICES
)
RULES = f"""\
#!/usr/bin/make -f
%:
\tdh $@ --sourcedirectory=src --buildsystem=cmake --with=python3
override_dh_auto_configure:
\tdh_auto_configure -- {" ".join(CMAKE_OPTIONS)}
override_dh_auto_test:
override_dh_installsystemd:
{INSTALL_SERVICES}\
override_dh_auto_install:
\tinstall -D -m 644 debian/hero.default debian/{SERVICES_PACKAGE}/etc/default/hero
"""

INSTALL = """\
\tDESTDIR=$(CURDIR)/debian/{name} cmake -P obj-$(DEB_HOST_GNU_TYPE)/{ros_name}/cmake_install.cmake
\tinstall -D -m 644 -t debian/{name}/usr/share/doc/{name} src/{ros_name}/CHANGELOG.rst
"""


def make_name(ros_name):
    """Return the name of a package's .deb: ros-hero-driver of hero_driver."""
    return "ros-" + ros_name.replace("_", "-")


@lru_cache(maxsize=None)
def list_packages():
    """Return the names of all packages of Debian."""
    return frozenset(check_output(["apt-cache", "pkgnames"], universal_newlines=True).split())


def find_known(key, *patterns):
    """Return those of the patterns, such as python3-*, that make the name of a Debian package of a rosdep key."""
    names = [pattern.replace("*", key.replace("_", "-")) for pattern in patterns]
    return [name for name in names if name not in OTHER_PROGRAMS and name in list_packages()]


def find_packages(key, *patterns):
    """Return the Debian packages of a rosdep key; ends with one line if there are none."""
    return find_known(key, *patterns) or sys.exit(f"debian_files.py: Debian has no package for the dependency {key}")


def find_relationships(package, own):
    """Return what the .deb of a package depends on, and what it recommends; own are the suite's packages."""
    depends, recommends = ["${misc:Depends}", "${python3:Depends}"], []
    for key in sorted(dependency.name for dependency in package.exec_depends):
        if key in own:
            depends.append(f"{make_name(key)} (= {package.version})")
            continue
        # ros-* is a program where there is no Python, else message definitions, for rosmsg and C++.
        definitions = find_known(key, "ros-*")
        names = find_known(key, "python3-*", "*") or find_packages(key, "ros-*")
        (recommends if key in RECOMMENDED else depends).extend(names)
        recommends += [name for name in definitions if name not in names]
    return depends, recommends


def write_services(directory):
    """Write the systemd units and their environment file, for debhelper to install."""
    for name, (description, command) in SERVICES.items():
        after = "" if name == "hero-master" else "hero-master@%i.service"
        text = SERVICE.format(description=description, command=command, after=after)
        (directory / f"{SERVICES_PACKAGE}.{name}@.service").write_text(text)
    (directory / "hero.default").write_text(ENVIRONMENT)


def write_debian_dir(sources, directory, build=""):
    """Write control, changelog, rules and services."""
    packages = [package for _, package in topological_order(str(sources))]
    for package in packages:
        # Newer than the release itself, older than the next one: every build is an upgrade.
        package.version += f"+git{build}" if build else ""
    own = {package.name for package in packages}
    first = packages[0]
    maintainer = f"{first.maintainers[0].name} <{first.maintainers[0].email}>"
    keys = {
        dependency.name
        for package in packages
        for dependency in package.buildtool_depends + package.build_depends
        if dependency.name not in own
    }
    build_depends = [name for key in sorted(keys) for name in find_packages(key, "lib*-dev", "python3-*", "ros-*", "*")]
    control = CONTROL.format(maintainer=maintainer, build_depends=", ".join(build_depends))
    rules = RULES
    for package in packages:
        name = make_name(package.name)
        depends, recommends = find_relationships(package, own)
        control += BINARY.format(
            name=name,
            ros_name=package.name,
            depends=", ".join(depends),
            recommends=", ".join(recommends),
            description=package.description.rstrip("."),
        )
        rules += INSTALL.format(name=name, ros_name=package.name)
    write_services(directory)
    (directory / "control").write_text(control)
    (directory / "rules").write_text(rules)
    (directory / "rules").chmod(0o755)
    (directory / "changelog").write_text(
        CHANGELOG.format(version=first.version, maintainer=maintainer, date=formatdate(localtime=True))
    )


if __name__ == "__main__":
    write_debian_dir(*map(Path, sys.argv[1:3]), *sys.argv[3:])
