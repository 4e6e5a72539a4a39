"""docs/migration.md says of each name of the stock packages what has become of it, and what stayed is there."""

import re

import pytest
import yaml

import documents
import sources

PAGE = sources.ROOT / "docs" / "migration.md"
NAMES = yaml.safe_load((sources.ROOT / "test" / "lint" / "stock_names.yaml").read_text())
FORMS = {"launch": "%s.launch", "arguments": "%s:=", "topics": "/hero_N/%s", "types": "%s", "names": "%s"}
SECTION = "## From the stock HeRo packages"
CASES = [(fate, kind, name) for fate, kinds in NAMES.items() for kind, names in kinds.items() for name in names]


def read_fates():
    """Return what the section's table says of each name in backticks in its first column; a name has one row."""
    lines = [line.text for line in documents.read_lines(PAGE)]
    first = lines.index(SECTION) + 1
    end = next(number for number, text in enumerate(lines) if number > first and text.startswith("## "))
    rows = [text.split("|")[1:3] for text in lines[first:end] if text.startswith("| ")]
    fates = [(name, now.strip()) for names, now in rows for name in documents.INLINE.findall(names)]
    assert len(dict(fates)) == len(fates), "a name has two rows"
    return dict(fates)


@pytest.mark.parametrize("fate, kind, name", CASES)
def test_each_name_of_the_stock_packages_has_its_row(fate, kind, name):
    now = read_fates()[FORMS[kind] % name]
    found = re.match("same|none", now)
    assert fate == (found.group() if found else "other"), now


def test_each_row_is_of_names_of_the_stock_packages():
    assert set(read_fates()) == {FORMS[kind] % name for _, kind, name in CASES}


@pytest.mark.parametrize("name", NAMES["same"]["launch"])
def test_launch_files_that_are_the_same_exist(name):
    assert sources.find(f"launch/{name}.launch")


@pytest.mark.parametrize("name", NAMES["same"]["topics"])
def test_topics_and_services_that_are_the_same_are_those_of_the_robots(name):
    robot = sources.ROOT / "hero_sim" / "src" / "hero_sim" / "robot"
    declared = (robot / "declarations.py").read_text() + (robot / "models.py").read_text()
    controller, _, last = name.rpartition("/")
    parts = ['%%s/%s/"' % controller, f'+ "{last}"'] if controller else ['%%s/%s"' % name]  # of both controllers
    assert all(part in declared for part in parts)


@pytest.mark.parametrize("name", NAMES["other"]["types"])
def test_types_of_the_stock_packages_are_in_hero_msgs(name):
    assert list((sources.ROOT / "hero_msgs").glob(f"*/{name}.*"))
