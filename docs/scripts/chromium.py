# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium without a network, driven by selenium."""

from __future__ import annotations

import shutil

from selenium import webdriver

from gdfe_ros.errors import GdfeError

PATIENCE = 300.0
"""Longest wait for the browser [s]. It is long because the processor draws if there is no graphics card."""
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_OPTIONS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)


def start(size: tuple[int, int], *, reachable: str = "") -> webdriver.Chrome:
    """Return the driver of a new browser that records its console and reaches no address except ``reachable``.

    Args:
        size: size of the window [px].
        reachable: reachable address; empty if no address is reachable.

    Raises:
        GdfeError: Chromium or its driver is not installed.
    """
    program, driver = next(filter(None, map(shutil.which, _BROWSERS)), None), shutil.which("chromedriver")
    if program is None or driver is None:
        raise GdfeError("this needs Chromium and its driver: make browser, or apt-get install chromium-driver")
    rules = "MAP * ~NOTFOUND" + (f" , EXCLUDE {reachable}" if reachable else "")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for option in (*_OPTIONS, "--window-size={},{}".format(*size), f"--host-resolver-rules={rules}"):
        options.add_argument(option)
    options.page_load_strategy = "none"  # no request waits for the page: on a busy machine it would time out
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    chrome = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    chrome.set_script_timeout(100.0)  # below the 120 s after which a request counts as lost
    return chrome
