#!/usr/bin/env python3
"""Who the fleet monitor lets in, asked over HTTP: names, origins, tokens, files, and how it refuses to start."""

import tempfile
import unittest
from pathlib import Path

import rostest
from monitor_process import (
    HOST,
    OTHER_HOST,
    PORT,
    TIMEOUT_S,
    UPGRADE,
    ask,
    end,
    start_monitor,
    wait_until_it_answers,
)

from hero_test.nonempty import nonempty

TOKEN = "correct-horse-battery-staple"


class AccessTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        wait_until_it_answers(HOST)

    def open_socket(self, host=HOST, **headers):
        named = {name.replace("_", "-"): value for name, value in headers.items()}
        return ask(host, "/live", {**UPGRADE, **named})[0]

    def test_a_name_that_is_not_this_machines_is_refused(self):
        for path in ("/", "/live", "/main.js", "/nothing"):
            status, headers, _ = ask(HOST, path, {"Host": "evil.example:%d" % PORT})
            self.assertEqual(status, 421, path)
            self.assertIn("default-src 'none'", headers["Content-Security-Policy"])

    def test_only_the_monitors_own_page_may_open_a_socket(self):
        self.assertEqual(self.open_socket(Origin="http://" + HOST), 101)
        self.assertEqual(self.open_socket(Origin="http://evil.example"), 403)
        self.assertEqual(self.open_socket(Origin="null"), 403)
        self.assertEqual(self.open_socket(), 403)

    def test_the_page_may_load_nothing_from_elsewhere_and_run_no_inline_script(self):
        _, headers, _ = ask(HOST)
        policy = headers["Content-Security-Policy"]
        self.assertIn("default-src 'none'", policy)
        self.assertIn("script-src 'self';", policy)
        self.assertNotIn("unsafe", policy)
        self.assertEqual(headers["X-Content-Type-Options"], "nosniff")

    def test_no_file_but_the_pages_own_is_served(self):
        for path in ("/../program.py", "/%2e%2e/program.py", "/web/main.js", "/..", "/.", "/etc/passwd"):
            self.assertEqual(ask(HOST, path)[0], 404, path)

    def test_it_does_not_start_for_other_machines_without_a_secret_token(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "token"
            file.write_text(TOKEN)
            file.chmod(0o600)
            started = []
            # Other wrong files and parameters: test_monitor_start.py.
            for arguments, reason in (
                (["_host:=0.0.0.0"], "needs a token"),
                (["_host:=nowhere.invalid", "_token_file:=%s" % file], "cannot listen"),
                (["_host:=a..b", "_token_file:=%s" % file], "cannot listen"),
            ):
                started.append((start_monitor(*arguments), reason))
            for process, reason in nonempty(started):
                output = process.communicate(timeout=TIMEOUT_S)[0].decode()
                self.assertEqual(process.returncode, 1, output)
                self.assertIn(reason, output)
                self.assertNotIn("Traceback", output)

    def test_a_port_that_is_taken_is_named(self):
        process = start_monitor("_port:=%d" % PORT)
        output = process.communicate(timeout=TIMEOUT_S)[0].decode()
        self.assertEqual(process.returncode, 1)
        self.assertIn("port %d" % PORT, output)

    def test_with_a_token_only_those_who_know_it_see_the_fleet(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "token"
            file.touch(mode=0o600)
            file.write_text(TOKEN + "\n")
            process = start_monitor("_host:=0.0.0.0", "_token_file:=%s" % file)
            host = OTHER_HOST
            own = {"Origin": "http://" + host}
            try:
                wait_until_it_answers(host)
                self.assertIn("login.js", ask(host)[2])
                self.assertEqual(self.open_socket(host, **own), 403)
                self.assertEqual(ask(host, "/picture/1", own)[0], 403)
                wrong = ask(host, "/login", own, "POST", '{"token": "wrong"}')
                self.assertEqual((wrong[0], wrong[1]["Set-Cookie"]), (403, None))
                self.assertEqual(ask(host, "/login", (), "POST", '{"token": "%s"}' % TOKEN)[0], 403)
                status, headers, _ = ask(host, "/login", own, "POST", '{"token": "%s"}' % TOKEN)
                self.assertEqual(status, 204)
                self.assertIn("HttpOnly", headers["Set-Cookie"])
                self.assertIn("SameSite=Strict", headers["Set-Cookie"])
                cookie = headers["Set-Cookie"].partition(";")[0]
                self.assertIn("main.js", ask(host, "/", {"Cookie": cookie})[2])
                self.assertEqual(ask(host, "/picture/1", {"Cookie": cookie})[0], 404)  # no camera
                self.assertEqual(self.open_socket(host, Cookie=cookie, **own), 101)
                self.assertEqual(self.open_socket(host, Cookie=cookie, Origin="http://evil.example"), 403)
            finally:
                output = end(process)
            self.assertNotIn(TOKEN, output)
            self.assertNotIn("Traceback", output)


if __name__ == "__main__":
    rostest.rosrun("hero_monitor", "test_monitor_access", AccessTest)
