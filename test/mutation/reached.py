"""pytest plugin that notes which lines of some modules each test executes, and how long it takes."""

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
        self.tests[item.nodeid] = [seconds, {path: sorted(found) for path, found in list(lines.items())}]

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
