"""Headless Chromium, driven by Selenium; tests that need it are skipped where either is missing."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
LOADED_S = 240.0  # in which any page is there, on a machine as busy as it may be
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


@contextmanager
def chromium(home: Path) -> Iterator[Any]:
    """Start a browser with its profile and downloads in a folder."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="Selenium is not installed (pip install selenium)")
    if not (CHROMIUM and DRIVER):
        pytest.skip("no Chromium with chromedriver is installed (apt install chromium-driver)")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={home / 'profile'}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.downloads = home / "downloads"
    driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(driver.downloads)})
    try:
        yield driver
    finally:
        driver.quit()


def open_page(browser: Any, page: Path, *, width: int, height: int = 900, end: str = "") -> None:
    """Open a page in a window of that size, its address with an end like `#rows`; forget what was logged before."""
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    browser.get("about:blank")
    browser.get_log("performance")
    browser.get_log("browser")
    browser.get(page.as_uri() + end)
    _wait_for(browser, page.as_uri())


def _wait_for(browser: Any, address: str) -> None:
    """Wait until a page is loaded to its end: the driver may return while its last scripts have not run."""
    from selenium.common import WebDriverException
    from selenium.webdriver.support.wait import WebDriverWait

    loaded = "return document.readyState === 'complete' && location.href.startsWith(arguments[0])"
    wait = WebDriverWait(browser, LOADED_S, 0.02, [WebDriverException])  # a script may be cut off by the new page
    wait.until(lambda each: each.execute_script(loaded, address))
