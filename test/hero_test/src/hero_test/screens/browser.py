"""Chromium without a window, for tests and pictures of web pages."""

import shutil

MISSING = [name for name in ("chromedriver", "chromium") if shutil.which(name) is None]

SCRIPT_TIMEOUT_S = 300.0
"""Only a test that fails waits this long; a busy machine needs its time."""


def open_browser(width, height):
    """Return a Chromium whose pages have this size in pixels; quit() ends it."""
    # Here, because machines without a browser skip these tests.
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    # No sandbox: it needs rights that containers lack, and only our own pages are shown.
    for name in ("headless=new", "no-sandbox", "disable-gpu", "disable-dev-shm-usage", "disable-background-networking"):
        options.add_argument("--" + name)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)
    browser.set_script_timeout(SCRIPT_TIMEOUT_S)
    set_page_size(browser, width, height)
    return browser


def set_page_size(browser, width, height):
    """Give the pages this size in pixels."""
    size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
