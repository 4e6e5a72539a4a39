#!/usr/bin/env python3
"""Runs pages of a course, or README and quick start, with the simulator: real commands in real terminals.

Usage: test_tutorials.py COURSE
"""

import os
import shutil
import sys
import tempfile
import unittest
from pathlib import Path

import rosgraph
import rostest

from hero_test.processes import find_free_port
from hero_test.tutorial_runner import Course

ROOT = Path(__file__).resolve().parents[3]
HERO = sorted((ROOT / "docs" / "tutorial" / "hero").glob("[0-9]*.md"))
PAGES = {
    "in_process": [ROOT / "docs" / "in_process.md"],
    "first_hour": [ROOT / "README.md", ROOT / "docs" / "quick_start.md"],
    "hero": HERO[:-1],
    "localization": HERO[-1:],  # needs no package of earlier pages
    "ros_basics": sorted((ROOT / "docs" / "tutorial" / "ros_basics").glob("[0-9]*.md")),
}

BUILD = "$ catkin build --this\n...\n"
BUILD_WITH_SUMMARY = BUILD + "[build] Summary: All ... packages succeeded!\n...\n"
AFTER_BUILDS = ("rosrun my_hero tutorial.py", "rosservice call", "rosrun my_first_package publisher_node.py")
"""What follows builds that the last page with one repeats for all programs: rosrun finds them without."""

PROGRAMS = {"hero": ("catkin", "vcs"), "ros_basics": ("catkin",)}  # Debian 11 has neither


def make_changes(course):
    """Return what differs between a reader's machine and this test: interpreter, build directory and port."""
    port = find_free_port()
    return {
        "/usr/bin/python3": sys.executable,
        # Debian 13's catkin takes only the second name; the others warn that they do not use it.
        "-DPYTHON_EXECUTABLE=": "-DPython_EXECUTABLE=%s -DPYTHON_EXECUTABLE=" % sys.executable,
        # What the first page makes and the last one uses: it runs without the first.
        **({"~/hero_ws/devel": "~/hero/.work/ws/devel"} if course == "localization" else {}),
        "~/hero/.work/ws/devel": os.environ["CMAKE_PREFIX_PATH"].split(":")[0],
        "<the address of this repository>": str(ROOT),
        "$ roslaunch hero_bringup hero_bringup.launch": "$ roslaunch hero_bringup hero_bringup.launch"
        " host:=127.0.0.1 port:=%d" % port,
        "0.0.0.0:11411": "127.0.0.1:%d" % port,
        "127.0.0.1:11411": "127.0.0.1:%d" % port,
        "sim:=true": "sim:=true port:=%d" % port,
        # A busy PC may need more than these seconds until all robots have moved.
        "rosrun hero_tools fleet --seconds 5 --expect 5": "until rosrun hero_tools fleet --seconds 5 --expect 5;"
        " do :; done",
        **{"%s$ %s" % (build, after): "$ " + after for build in (BUILD_WITH_SUMMARY, BUILD) for after in AFTER_BUILDS},
    }


class TutorialsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        home = tempfile.TemporaryDirectory(prefix="tutorials_")
        cls.addClassCleanup(home.cleanup)
        cls.course = Course(Path(home.name), make_changes(sys.argv[1]))
        cls.addClassCleanup(cls.course.close)
        cls.failed = None
        cls.master = rosgraph.Master("tutorials")
        cls.own_parameters = frozenset(cls.master.getParamNames())

    def run_page(self, page):
        if self.failed:
            self.skipTest("the pages build on each other: " + self.failed)
        try:
            self.course.run_page(page)
        except Exception as error:
            type(self).failed = str(error).splitlines()[0]
            raise
        # A reader's master ends with what he starts first on a page; the test's keeps the parameters of all pages.
        for name in set(self.master.getParamNames()) - self.own_parameters:
            self.master.deleteParam(name)


def add_pages(pages):
    """Add one test per page. Of pages without numbers, the order of the names is that of the pages, too."""
    for page in pages:
        name = "test_%s_works_as_shown" % page.stem
        setattr(TutorialsTest, name, lambda self, page=page: self.run_page(page))


if __name__ == "__main__":
    course = sys.argv[1]
    add_pages(PAGES[course])
    missing = [name for name in PROGRAMS.get(course, ()) if shutil.which(name) is None]
    tests = unittest.skipIf(missing, "not installed: " + ", ".join(missing))(TutorialsTest)
    rostest.rosrun("hero_tutorial", "tutorials_" + course, tests, sys.argv)
