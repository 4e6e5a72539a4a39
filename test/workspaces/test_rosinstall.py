"""rosinstall.yaml brings the suite into a workspace, with vcs and with wstool."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TIMEOUT_S = 120.0


def run(command, directory):
    """Run a shell command; its failure fails the test, a tool that is not there skips it."""
    tool = command.split()[0]
    if "/" not in tool and shutil.which(tool) is None:
        pytest.skip(f"{tool} is not installed")
    result = subprocess.run(
        command,
        shell=True,
        cwd=str(directory),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=TIMEOUT_S,
        check=False,
    )
    output = result.stdout.decode(errors="replace")
    assert result.returncode == 0, f"{command}\n{output}"


@pytest.fixture()
def workspace(tmp_path):
    """A workspace, beside whose src the suite was cloned as hero; on a branch, as a user's clone is."""
    if not (ROOT / ".git").exists():
        pytest.skip("not a git clone")
    (tmp_path / "src").mkdir()
    run(f"git clone --quiet {ROOT} hero && git -C hero checkout --quiet -B main", tmp_path)
    # The files as they are now, committed or not.
    for name in ("rosinstall.yaml", "script/rosinstall", "script/environment"):
        shutil.copy2(str(ROOT / name), str(tmp_path / "hero" / name))
    return tmp_path


def packages_in(workspace):
    return {path.parent.name for path in (workspace / "src" / "hero").glob("*/package.xml")}


def test_vcs_reads_the_file_of_a_clone_beside_src(workspace):
    run("vcs import src < hero/rosinstall.yaml", workspace)
    assert "hero_driver" in packages_in(workspace)


@pytest.mark.parametrize("command", ["vcs import src < hero.rosinstall", "wstool init src hero.rosinstall"])
def test_both_tools_fetch_the_suite_from_the_address_of_the_clone(workspace, command):
    run("git -C hero remote remove origin", workspace)
    run("hero/script/rosinstall > hero.rosinstall", workspace)
    run(command, workspace)
    assert "hero_driver" in packages_in(workspace)
