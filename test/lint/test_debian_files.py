"""The files that make .debs of the packages: versions that rise, and services that are not started by themselves."""

import shutil
import subprocess
import sys

import pytest

import sources

PROGRAM = sources.ROOT / "packaging" / "debian_files.py"
pytestmark = pytest.mark.skipif(shutil.which("apt-cache") is None, reason="names of Debian's packages: only on Debian")


@pytest.fixture(scope="module")
def debian(tmp_path_factory):
    """Return the folder debian/ of a build."""
    folder = tmp_path_factory.mktemp("debs")
    for name, path in sources.PACKAGES.items():
        (folder / "src" / name).mkdir(parents=True)
        shutil.copy(str(path / "package.xml"), str(folder / "src" / name))
    (folder / "debian").mkdir()
    program = [sys.executable, str(PROGRAM), str(folder / "src"), str(folder / "debian"), "20261126.412"]
    subprocess.run(program, check=True)
    return folder / "debian"


def test_each_build_is_an_upgrade_of_the_release_and_of_earlier_builds(debian):
    first = (debian / "changelog").read_text().splitlines()[0]
    version = first.partition("(")[2].partition(")")[0]
    release, _, build = version.partition("+git")
    assert build == "20261126.412"

    def is_newer(new, old):
        return subprocess.call(["dpkg", "--compare-versions", new, "gt", old]) == 0

    assert is_newer(version, release)
    assert is_newer(version, release + "+git20261126.99") and is_newer(version, release + "+git20251231.999")
    assert is_newer(release + ".1", version)
    assert f"ros-hero-node (= {version})" in (debian / "control").read_text()


def test_every_package_is_built_and_installed(debian):
    control, rules = (debian / "control").read_text(), (debian / "rules").read_text()
    for name in sources.PACKAGES:
        assert f"Package: ros-{name.replace('_', '-')}\n" in control
        assert f"/{name}/cmake_install.cmake\n" in rules


def test_services_are_installed_but_neither_enabled_nor_started(debian):
    services = sorted(path.name for path in debian.glob("*.service"))
    assert len(services) == 5
    rules = (debian / "rules").read_text()
    for service in services:
        package, name = service[: -len(".service")].split(".")
        assert f"\tdh_installsystemd -p{package} --name={name} --no-enable --no-start\n" in rules
        text = (debian / service).read_text()
        # Ctrl-C goes to roslaunch alone, which ends its nodes: the driver stops the robots first.
        assert "KillMode=mixed\nKillSignal=SIGINT\n" in text and "Restart=on-failure\n" in text
        assert ("hero-master@%i.service" in text) == ("master" not in name)
