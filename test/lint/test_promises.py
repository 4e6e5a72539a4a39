"""Each promise that a document makes names a test that exists."""

import re

import pytest
import sources

PAGES = ("docs/reliability.md", "docs/security.md")
TEST_NAME = re.compile(r"`(test_\w+)`")
DEFINITION = re.compile(r"^ *def (test_\w+)\(", re.MULTILINE)

PROMISED = [
    (page, name)
    for page in PAGES
    for name in TEST_NAME.findall((sources.ROOT / page).read_text(encoding="utf-8"))
]
DEFINED = {
    name
    for path in sources.list_python_files()
    if "test" in path.parts
    for name in DEFINITION.findall(path.read_text(encoding="utf-8"))
}


@pytest.mark.parametrize(("page", "name"), PROMISED)
def test_the_test_that_holds_a_promise_exists(page, name):
    assert name in DEFINED, "%s names %s, which no file defines" % (page, name)


@pytest.mark.parametrize("page", PAGES)
def test_no_promise_in_a_table_goes_without_a_test(page):
    rows = [
        line
        for line in (sources.ROOT / page).read_text(encoding="utf-8").splitlines()
        if line.startswith("|")
    ]
    header = None
    for row in rows:
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        if cells[-1] == "Test":
            header = cells
        elif set(row) <= set("|-: "):
            continue
        elif header is not None and len(cells) == len(header):
            assert TEST_NAME.search(cells[-1]) or "](" in cells[-1], "%s: %s" % (page, row)
        else:
            header = None
