"""Gives MkDocs the Markdown files of the repository and what they link to (a hook of MkDocs).

Files keep their places, so that a link holds in the repository and in the rendered pages alike.
"""

import fnmatch
import os
import re
import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / ".work" / "docs_pages"
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")
SITE_FILES = {Path("docs/site/pages.css"), Path("docs/site/iframe-worker.js")}
CONSOLE = re.compile(r"(<!-- tutorial: .* -->\n)?```console\n")
TERMINAL = re.compile(r"<!-- tutorial: terminal (\d+)")
NOT_PAGES = {".work", ".git", "build", "devel", "install", "node_modules"}


def find_pages():
    """Return the paths of all Markdown files, relative to the repository."""
    found = []
    for folder, folders, names in os.walk(ROOT):
        folders[:] = sorted(set(folders) - NOT_PAGES)
        found += [Path(folder, name).relative_to(ROOT) for name in names if name.endswith(".md")]
    return sorted(found)


def find_linked_files(page):
    """Return the files of the repository, other than pages, that a page links to."""
    text = re.sub(r"```.*?```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    for target in LINK.findall(text):
        path = (ROOT / page.parent / target).resolve()
        if not re.match("[a-z]+:", target) and path.is_file() and path.suffix != ".md" and ROOT in path.parents:
            yield path.relative_to(ROOT)


def copy_changed(paths):
    """Make PAGES hold exactly these files."""
    for old in [path for path in PAGES.rglob("*") if path.is_file()]:
        if old.relative_to(PAGES) not in paths:
            old.unlink()
    for path in paths:
        copy = PAGES / path
        if not copy.is_file() or copy.read_bytes() != (ROOT / path).read_bytes():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / path, copy)


def expand(menu, pages, taken):
    """Replace patterns in the menu by the pages that they name and that stand nowhere else in it."""
    entries = []
    for entry in menu:
        if isinstance(entry, dict):
            ((title, below),) = entry.items()
            below = expand([below] if isinstance(below, str) else below, pages, taken)
            entries += [{title: below}] if below else []
        elif "*" in entry:
            depth = entry.count("/")
            for page in pages:
                if fnmatch.fnmatch(page, entry) and page.count("/") == depth and page not in taken:
                    taken.add(page)
                    entries.append(page)
        else:
            entries.append(entry)
    return entries


def list_fixed(menu):
    """Yield the pages that the menu names in full."""
    for entry in menu:
        if isinstance(entry, dict):
            below = next(iter(entry.values()))
            yield from list_fixed([below] if isinstance(below, str) else below)
        elif "*" not in entry:
            yield entry


def on_page_markdown(markdown, **_):
    """Called by MkDocs for each page: write over each console block in which terminal it is typed."""
    if not TERMINAL.search(markdown):
        return markdown  # one terminal is enough for this page

    def add_title(block):
        terminal = TERMINAL.search(block.group(1) or "")
        return '```console title="Terminal %s"\n' % (terminal.group(1) if terminal else "1")

    return CONSOLE.sub(add_title, markdown)


def on_config(config):
    """Called by MkDocs before it reads the pages, and again before each new rendering."""
    pages = find_pages()
    copy_changed({*SITE_FILES, *pages, *(path for page in pages for path in find_linked_files(page))})
    config.nav = expand(config.nav, [page.as_posix() for page in pages], set(list_fixed(config.nav)))
    return config
