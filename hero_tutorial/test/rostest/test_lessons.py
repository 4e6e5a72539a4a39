#!/usr/bin/env python3
"""Goes through the pages of one course: ROS master of the rostest, simulator, real commands in real terminals."""

import os
import sys
import tempfile
import unittest
from pathlib import Path

import rostest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from lesson_runner import Course

from hero_test.processes import find_free_port

PACKAGE = Path(__file__).resolve().parents[2]
PAGES = PACKAGE.parent / "docs" / "tutorial"


def make_changes():
    """What differs between a reader's machine and a test: which python, where the suite is built, which port."""
    port = find_free_port()
    return {
        "/usr/bin/python3": sys.executable,
        "~/hero/.work/ws/devel": os.environ["CMAKE_PREFIX_PATH"].split(":")[0],
        "<the address of this repository>": str(PACKAGE.parent),
        "$ roslaunch hero_bringup hero_bringup.launch": "$ roslaunch hero_bringup hero_bringup.launch"
        " host:=127.0.0.1 port:=%d" % port,
        "0.0.0.0:11411": "127.0.0.1:%d" % port,
        "sim:=true": "sim:=true port:=%d" % port,
    }


class LessonsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.home = tempfile.TemporaryDirectory(prefix="lessons_")
        cls.course = Course(Path(cls.home.name), PACKAGE, make_changes())
        cls.failed = None

    @classmethod
    def tearDownClass(cls):
        cls.course.close()
        cls.home.cleanup()

    def run_page(self, page):
        if self.failed:
            self.fail("not tried, because the pages build on each other: " + self.failed)
        try:
            self.course.run_page(page)
        except Exception as error:
            type(self).failed = str(error).splitlines()[0]
            raise


def add_pages(course):
    """One test for each page, in the order of their names."""
    for page in sorted((PAGES / course).glob("[0-9]*.md")):
        name = "test_%s_does_what_the_page_says" % page.stem
        setattr(LessonsTest, name, lambda self, page=page: self.run_page(page))


if __name__ == "__main__":
    add_pages(sys.argv[1])
    rostest.rosrun("hero_tutorial", "lessons_%s" % sys.argv[1], LessonsTest, sys.argv)
