"""pytest plugin that notes which lines of some modules each test executes, and how long it takes.

What a fixture of a module or a session executes counts for all tests that use it, not only for the first one.
"""

import os
import sys
import threading
import time

import pytest


class ReachedLines:
    """What each test executes of the modules with these paths: {test: [CPU seconds, {path: [line, ...]}]}."""

    def __init__(self, paths):
        self._paths = set(paths)
        self._real_paths = {}
        self._lines = {}
        self._shared = {}  # fixture -> its CPU seconds and lines
        self.tests = {}

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self, item):
        self._lines = lines = {}
        start_s = time.process_time()
        sys.settrace(self._enter)
        threading.settrace(self._enter)
        yield
        sys.settrace(None)
        threading.settrace(None)
        seconds = time.process_time() - start_s
        used = [found[-1] for found in item._fixtureinfo.name2fixturedefs.values()]
        for own_s, own in (self._shared[fixture] for fixture in used if fixture in self._shared):
            seconds += own_s
            for path, numbers in own.items():
                lines.setdefault(path, set()).update(numbers)
        self.tests[item.nodeid] = [seconds, {path: sorted(found) for path, found in list(lines.items())}]

    @pytest.hookimpl(hookwrapper=True)
    def pytest_fixture_setup(self, fixturedef):
        of_test, start_s = self._lines, time.process_time()
        is_shared = fixturedef.scope != "function"
        if is_shared:
            self._lines = {}
        yield
        if is_shared:
            self._shared[fixturedef] = time.process_time() - start_s, self._lines
            self._lines = of_test

    def _enter(self, frame, event, argument):
        name = frame.f_code.co_filename
        path = self._real_paths.get(name)
        if path is None:
            path = self._real_paths[name] = os.path.realpath(name)
        if path not in self._paths:
            return None
        add = self._lines.setdefault(path, set()).add

        def note(frame, event, argument):
            add(frame.f_lineno)
            return note

        return note
