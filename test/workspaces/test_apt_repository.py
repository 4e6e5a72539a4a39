"""script/apt_repository: apt installs from what it makes, and only with the key that signed it."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("gpg", "dpkg-scanpackages", "dpkg-deb", "apt-get")
MISSING = [name for name in TOOLS if shutil.which(name) is None]
CONTROL = "Package: ros-hero\nVersion: 0.2.0\nArchitecture: all\nMaintainer: A <a@example.org>\nDescription: robots\n"

pytestmark = pytest.mark.skipif(bool(MISSING), reason="not installed: " + ", ".join(MISSING))


@pytest.fixture()
def environment(tmp_path):
    """Return an environment with a .deb and a new secret key."""
    package = tmp_path / "package" / "DEBIAN"
    package.mkdir(parents=True)
    (package / "control").write_text(CONTROL)
    (tmp_path / "debs").mkdir()
    run("dpkg-deb", "--build", str(package.parent), str(tmp_path / "debs" / "ros-hero_0.2.0_all.deb"))
    (tmp_path / "keys").mkdir(mode=0o700)
    environment = dict(os.environ, GNUPGHOME=str(tmp_path / "keys"), HERO_DEBS=str(tmp_path / "debs"))
    address = "Packager <packager@example.org>"
    run("gpg", "--batch", "--passphrase", "", "--quick-generate-key", address, "default", "sign", env=environment)
    yield environment
    run("gpgconf", "--kill", "all", env=environment)


def run(*command, **options):
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)


def ask_apt(folder, key, *command):
    """Return what apt says with only this repository in its lists."""
    lists = folder / "lists"
    shutil.rmtree(str(lists), ignore_errors=True)
    for name in ("state/partial", "cache/archives/partial"):
        (lists / name).mkdir(parents=True)
    (release,) = [path.parent for path in folder.glob("*/InRelease")]
    (lists / "sources.list").write_text(f"deb [signed-by={key}] file:{release} ./\n")
    settings = {
        "Dir::State::lists": lists / "state",
        "Dir::Cache": lists / "cache",
        "Dir::Etc::sourcelist": lists / "sources.list",
        "Dir::Etc::sourceparts": "/dev/null",
        "APT::Sandbox::User": "",
    }
    options = ["-o%s=%s" % setting for setting in settings.items()]
    run("apt-get", *options, "--error-on=any", "update")
    return run(command[0], *options, *command[1:]).stdout


def test_apt_finds_the_packages_with_the_key_and_refuses_them_with_another(environment, tmp_path):
    folder = tmp_path / "repository"
    script = str(ROOT / "script" / "apt_repository")
    output = run(script, str(folder), "--key", "packager@example.org", env=environment).stdout
    assert "1 packages for" in output
    found = ask_apt(folder, folder / "hero.gpg", "apt-cache", "policy", "ros-hero")
    assert "Candidate: 0.2.0" in found and str(folder) in found
    (tmp_path / "empty.gpg").write_bytes(b"")
    with pytest.raises(subprocess.CalledProcessError) as refused:
        ask_apt(folder, tmp_path / "empty.gpg", "apt-cache", "policy", "ros-hero")
    assert "InRelease" in refused.value.output


def test_a_key_that_gpg_does_not_have_is_named_with_the_remedy(environment, tmp_path):
    command = [str(ROOT / "script" / "apt_repository"), str(tmp_path / "repository"), "--key", "nobody@example.org"]
    with pytest.raises(subprocess.CalledProcessError) as refused:
        run(*command, env=environment)
    assert "gpg --list-secret-keys" in refused.value.output
