"""The pages of the courses, without running them; the rostests run them."""

import ast
import re
from pathlib import Path

import pytest

from hero_test.tutorial_runner import read_blocks

PACKAGE = Path(__file__).resolve().parents[2]
TUTORIAL = PACKAGE.parent / "docs" / "tutorial"
PAGES = sorted(TUTORIAL.glob("*/[0-9]*.md"))
SECTIONS = ["Goal", "Steps", "How it works", "Exercise", "Solution"]


def name_of(path):
    return str(path.relative_to(TUTORIAL))


def test_both_courses_are_complete():
    assert len([page for page in PAGES if page.parent.name == "ros_basics"]) == 7
    assert len([page for page in PAGES if page.parent.name == "hero"]) == 15


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_page_has_the_same_sections_and_lists_common_mistakes(page):
    outside = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    assert re.findall(r"^## (.*)$", outside, flags=re.MULTILINE) == SECTIONS
    assert re.match(r"# %d\. " % int(page.name[:2]), outside)
    assert "**Common mistakes.**" in outside


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_block_can_be_parsed(page):
    for block in read_blocks(page):
        if block.language == "console":
            block.read_steps(page)
        elif block.file and block.file.endswith(".py"):
            ast.parse(block.text, feature_version=(3, 8))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_the_overview_lists_every_page(page):
    assert f"({name_of(page)})" in (TUTORIAL / "README.md").read_text(encoding="utf-8")


def test_the_package_takes_scripts_from_pages_that_have_them_written():
    written = {(page, block.file) for page in PAGES for block in read_blocks(page) if block.language == "python"}
    shown = {(name_of(page), Path(file).name) for page, file in written if file and "/scripts/" in file}
    made = re.findall(
        r"hero_add_page_script\(\.\./docs/tutorial/(\S+) (\w+\.py)", (PACKAGE / "CMakeLists.txt").read_text()
    )
    assert set(made) <= shown and len(made) == 18
