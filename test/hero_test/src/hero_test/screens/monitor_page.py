"""The fleet monitor's page in a real browser without a screen, for tests and pictures."""

import contextlib
import os
from pathlib import Path

from hero_test.screens.browser import open_browser, set_page_size
from hero_test.waiting import TIMEOUT_S, wait_for

KEEP_NOTICES = (
    "window.notices = []; const keep = (one) => window.notices.push(one.textContent);"
    "new MutationObserver((changes) => changes.forEach((change) => change.addedNodes.forEach(keep)))"
    ".observe(document.getElementById('notices'), { childList: true })"
)

CLICK_ROW = (
    "const rows = [...document.querySelectorAll('#fleet tbody button')];"
    "const found = rows.find((one) => one.textContent === arguments[0]);"
    "if (found) found.click(); return !!found"
)
# By no timer: a test may have taken the page's clock.
AWAIT_TEXT = (
    "const [selector, text, done] = arguments;"
    "const look = () => {"
    "  if (!document.querySelector(selector)?.textContent.includes(text)) return;"
    "  observer.disconnect();"
    "  done();"
    "};"
    "const observer = new MutationObserver(look);"
    "observer.observe(document, { subtree: true, childList: true, characterData: true });"
    "look();"
)
READ_BANNER = "const banner = document.getElementById('stopping'); return [banner.dataset.level, banner.textContent]"


class MonitorPage:
    """Chromium, which shows the page at an address from open() on."""

    def __init__(self, url):
        self.browser = open_browser(1440, 900)
        self.browser.set_script_timeout(TIMEOUT_S)
        self.url = url

    def open(self):
        self.browser.get(self.url)
        self.run(KEEP_NOTICES)

    def leave(self):
        """Show nothing until open(): an open page costs CPU time."""
        self.browser.get("about:blank")

    def resize(self, width, height):
        set_page_size(self.browser, width, height)

    def find(self, selector):
        return self.browser.find_element("css selector", selector)

    def click(self, selector):
        self.find(selector).click()

    def text(self, selector):
        """Return the text of an element, also where it is scrolled out of sight."""
        return self.find(selector).get_property("textContent").strip()

    def run(self, script):
        return self.browser.execute_script(script)

    def rows(self):
        """Return the texts of the table by heading, of each robot; also those of columns that are not shown."""
        heads, *rows = self.run(
            "return [...document.querySelectorAll('#fleet tr')]"
            ".map(row => [...row.children].map(cell => cell.textContent))"
        )
        return [dict(zip(heads, row)) for row in rows]

    def facts(self):
        """Return what is shown of the chosen robot: texts by title."""
        titles, texts = (
            self.run("return [...document.querySelectorAll('#facts %s')].map(one => one.textContent)" % tag)
            for tag in ("dt", "dd")
        )
        return dict(zip(titles, texts))

    def banner(self):
        """Return level and text of what is shown about stopping."""
        return tuple(self.run(READ_BANNER))

    def press_stop(self):
        """Click on STOP ALL and return the banner in the same moment: an answer may follow."""
        return tuple(self.run("document.getElementById('stop').click();" + READ_BANNER))

    def hold_release(self):
        """Hold Release until robots are released; it does nothing for a while after a stop."""
        wait_for(lambda: not self.run("return document.querySelector('#release.inert')"), "the end of the delay")
        is_released = "return document.getElementById('release_bar').hidden"
        self._hold(self.find("#release"), "#release.holding", lambda: self.run(is_released), "the release")
        self.actions().release().perform()

    def choose(self, robot):
        """Choose a robot in the table."""
        wait_for(lambda: self.browser.execute_script(CLICK_ROW, robot), "a row of " + robot)
        wait_for(lambda: self.text("#name") == robot, robot + " to be chosen")

    def hold(self, direction, condition, what):
        """Hold a button of the pad until a condition is true; again where a busy PC has ended the hold."""
        self._hold(self.find("#pad [aria-label='%s']" % direction), "#pad .down", condition, what)

    def _hold(self, button, held, condition, what):
        """Hold a button, which the selector `held` finds meanwhile, until a condition is true; again where it ended."""
        from selenium.common.exceptions import ElementNotInteractableException

        def press():
            # A button that has gone since has done what it was held for, which the condition is about to tell.
            with contextlib.suppress(ElementNotInteractableException):
                self.actions().release().click_and_hold(button).perform()

        def is_true():
            if condition():
                return True
            if not self.run("return !!document.querySelector('%s')" % held):
                press()
            return False

        press()
        wait_for(is_true, what)

    def send_key(self, kind, code, **more):
        """Send a keyDown or keyUp to what has the focus."""
        self.browser.execute_cdp_cmd("Input.dispatchKeyEvent", {"type": kind, "code": code, "key": code, **more})

    def wait_for_text(self, selector, text):
        """Wait until an element holds a text; the page says when, which costs less than asking it again and again."""
        from selenium.common.exceptions import WebDriverException

        try:
            self.browser.execute_async_script(AWAIT_TEXT, selector, text)
        except WebDriverException:  # it was loaded anew meanwhile, or the time is over
            wait_for(lambda: text in self.text(selector), "%r in %s" % (text, selector))

    def wait_for_notice(self, text):
        """Wait until a notice with this text was shown since the page was opened: notices vanish after some seconds."""
        wait_for(lambda: any(text in notice for notice in self.notices()), lambda: "%r in %s" % (text, self.notices()))

    def notices(self):
        return self.run("return window.notices")

    def actions(self):
        from selenium.webdriver.common.action_chains import ActionChains

        return ActionChains(self.browser)

    def save(self, name):
        """Save a picture beside the test's results."""
        folder = Path(os.environ.get("ROS_TEST_RESULTS_DIR", "."))
        self.browser.save_screenshot(str(folder / name))

    def errors(self):
        """Return what the browser complained about since the last call."""
        return [line["message"] for line in self.browser.get_log("browser") if line["level"] == "SEVERE"]

    def close(self):
        self.browser.quit()
