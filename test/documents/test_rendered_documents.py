"""The pages that script/docs renders, opened as files in a browser: links, search, what is copied, what fits.

A broken link, or a page that is missing in the menu, fails the rendering.
"""

import re
import subprocess
from pathlib import Path

import pytest

from hero_test.screens.browser import MISSING, open_browser
from hero_test.waiting import wait_for

ROOT = Path(__file__).resolve().parents[2]
RENDERED = ROOT / ".work" / "docs"
NEXT_PAGE = "a.md-footer__link--next"

FIND_CUT_LINES = """
return [...document.querySelectorAll("pre > code")].filter(code => code.scrollWidth > code.clientWidth)
    .map(code => code.closest("article").dataset.page + ": " + code.innerText)"""

# Lines may break at spaces, and where CSS allows it anyway: after hyphens and slashes.
FIND_BROKEN_WORDS = r"""
const broken = [];
for (const cell of document.querySelectorAll("td, th")) {
    const texts = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
    for (let text; text = texts.nextNode();)
        for (const word of text.data.matchAll(/[^\s\/-]+/g)) {
            const range = document.createRange();
            range.setStart(text, word.index);
            range.setEnd(text, word.index + word[0].length);
            const lines = [...range.getClientRects()].filter(box => box.width > 0).map(box => Math.round(box.top));
            if (new Set(lines).size > 1) broken.push(cell.closest("article").dataset.page + ": " + word[0]);
        }
}
return broken;"""


@pytest.fixture(scope="module")
def pages():
    """The address of the rendered pages."""
    result = subprocess.run(
        [ROOT / "script" / "docs"],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout
    return RENDERED.as_uri()


@pytest.fixture(scope="module")
def browser():
    if MISSING:
        pytest.skip(f"not installed: {', '.join(MISSING)} (script/bootstrap --test)")
    browser = open_browser(1366, 768)
    yield browser
    browser.quit()


def find(browser, selector):
    """Return the first such element, once the page has one."""
    return wait_for(lambda: browser.find_elements("css selector", selector), selector)[0]


def test_all_pages_render_without_a_warning(pages):
    assert (RENDERED / "index.html").is_file()


def test_search_finds_pages_without_a_server(pages, browser):
    browser.get(pages + "/index.html")
    find(browser, "input[name=query]").send_keys("odometry")
    find_titles = "return [...document.querySelectorAll('.md-search-result__item h1')].map(title => title.innerText)"
    wait_for(lambda: "8. Odometry" in browser.execute_script(find_titles), "the page is found")


def test_the_copy_button_copies_commands_alone(pages, browser):
    from selenium.webdriver.common.keys import Keys

    browser.get(pages + "/docs/tutorial/ros_basics/05_subscriber.html")
    block = find(browser, ".highlight:has(.gp)")
    assert "$ rosrun" in block.text and "[build] Summary" in block.text
    button = wait_for(lambda: block.find_elements("css selector", "button[data-clipboard-target]"), "it")[0]
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", button)
    button.click()
    browser.execute_script("document.body.prepend(document.createElement('textarea'))")
    field = browser.find_element("css selector", "textarea")
    field.send_keys(Keys.CONTROL, "v")
    assert field.get_property("value").splitlines() == [
        "cd ~/catkin_ws/src/my_first_package",
        "chmod +x scripts/subscriber_node.py",
        "echo 'catkin_install_python(PROGRAMS scripts/subscriber_node.py"
        " DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})' >> CMakeLists.txt",
        "catkin build --this",
        "rosrun my_first_package publisher_node.py",
    ]


def join_pages():
    """Return a page with the contents of all, of the same width, and their number: one by one they load for 12 s."""
    found = {}
    for path in sorted(RENDERED.rglob("*.html")):
        (found[path],) = re.findall("<article .*?</article>", path.read_text(encoding="utf-8"), re.DOTALL)
    contents = ""
    for path, article in found.items():
        contents += article.replace("<article", f'<article data-page="{path.relative_to(RENDERED)}"', 1)
    index = RENDERED / "index.html"
    return index.read_text(encoding="utf-8").replace(found[index], contents), len(found)


def test_no_code_is_cut_and_no_word_in_a_table_is_broken(pages, browser):
    text, count = join_pages()
    joined = RENDERED / "all_pages.html"
    joined.write_text(text, encoding="utf-8")
    browser.get(joined.as_uri())
    joined.unlink()
    wait_for(lambda: len(browser.find_elements("css selector", "article[data-page]")) == count, "all pages")
    assert browser.execute_script(FIND_CUT_LINES) == []
    assert browser.execute_script(FIND_BROKEN_WORDS) == []


def test_blocks_name_their_terminal_where_there_are_several(pages, browser):
    browser.get(pages + "/docs/tutorial/ros_basics/03_node.html")
    find_titles = "return [...document.querySelectorAll('.filename')].map(title => title.innerText).slice(0, 4)"
    expected = ["Terminal 1", "Terminal 2", "Terminal 2", "Terminal 3"]
    wait_for(lambda: browser.execute_script(find_titles) == expected, lambda: browser.execute_script(find_titles))


def test_each_tutorial_leads_to_the_next(pages, browser):
    course = sorted((ROOT / "docs" / "tutorial" / "hero").glob("[0-9]*.md"))
    browser.get(f"{pages}/docs/tutorial/hero/{course[0].stem}.html")
    for page in course[1:]:
        browser.get(find(browser, NEXT_PAGE).get_attribute("href"))
        end = f"/{page.stem}.html"
        wait_for(lambda end=end: browser.current_url.endswith(end), lambda: browser.current_url)
