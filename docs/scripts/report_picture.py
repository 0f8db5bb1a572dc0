# SPDX-License-Identifier: Apache-2.0
"""Draws the picture of a report in the documentation: a screenshot of Chromium.

python -m docs.scripts.report_picture
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from selenium.webdriver.support.ui import WebDriverWait

from docs.scripts import chromium
from gdfe_ros.cli import main as gdfe

ROOT = Path(__file__).parents[2]
BAG, FRAME = "bags/pneunet", 6
"""The kept bag, and the frame that is shown with the inside."""
SHOW = f"""
for (const [id, key, value, event] of [["time", "value", {FRAME}, "input"], ["inside", "checked", true, "change"]]) {{
  const part = document.getElementById(id);
  part[key] = value;
  part.dispatchEvent(new Event(event));
}}
"""


def main() -> None:
    """Write the report of the bag, show one frame in Chromium, and save a screenshot."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        if gdfe(["report", str(ROOT / BAG), "--out", str(page)]):
            raise SystemExit("the report was not written")
        chrome = chromium.start((1300, 1100))
        try:
            chrome.get(page.as_uri())
            ready = "return document.readyState === 'complete' && !!document.querySelector('#charts .main-svg')"
            WebDriverWait(chrome, chromium.PATIENCE).until(lambda found: found.execute_script(ready))
            chrome.execute_script(SHOW)
            drawn = "return document.getElementById('moment').textContent.includes('frame 7')"
            WebDriverWait(chrome, chromium.PATIENCE).until(lambda found: found.execute_script(drawn))
            chrome.execute_async_script("requestAnimationFrame(() => requestAnimationFrame(arguments[0]))")
            chrome.save_screenshot(str(ROOT / "docs/images/report.png"))
        finally:
            chrome.quit()


if __name__ == "__main__":
    main()
