"""Foxglove Studio 1.48 in headless Chromium: the last version whose code is public, from its package on npm."""

import io
import json
import os
import re
import shutil
import threading
from contextlib import contextmanager, suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.npm import kept

from semgrid_eval.classes import DEFAULT_CLASSES

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
PACKAGES = ("@foxglove/studio-base@1.48.0", "react@17.0.2", "react-dom@17.0.2")
PAGE = Path(__file__).parents[1] / "viewers" / "page.html"
ASKED = "SEMGRID_VIEWERS"
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--window-size=1500,950",
)


PATIENCE_S = 240  # until something is given up that takes a few seconds
_HEADERS = "header[data-testid=mosaic-drag-handle]"


def require_viewers():
    """Skip a test that downloads a viewer, unless viewers are asked for."""
    if not os.environ.get(ASKED):
        pytest.skip(f"Foxglove Studio is 36 MB from npm and takes a minute: set {ASKED}=1 to test with them")


class _Ranged(SimpleHTTPRequestHandler):
    """Serves parts of files, as viewers ask for logs."""

    def log_message(self, *_):
        pass

    def do_HEAD(self):
        self._serve(with_body=False)

    def do_GET(self):
        self._serve(with_body=True)

    def _serve(self, *, with_body):
        path = Path(self.translate_path(self.path))
        if not path.is_file():
            self.send_error(404)
            return
        content = path.read_bytes()
        asked = re.match(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        first, last = (int(asked[1]), int(asked[2] or len(content) - 1)) if asked else (0, len(content) - 1)
        self.send_response(206 if asked else 200)
        self.send_header("Accept-Ranges", "bytes")
        self.send_header("Content-Type", self.guess_type(path))
        self.send_header("Content-Length", str(last - first + 1))
        if asked:
            self.send_header("Content-Range", f"bytes {first}-{last}/{len(content)}")
        self.end_headers()
        if with_body:
            with suppress(ConnectionError):
                self.wfile.write(content[first : last + 1])


@contextmanager
def served(log, layout, folder):
    """Serve Studio with a log and a layout on loopback, and return the address of the page."""
    (folder / "node_modules").symlink_to(kept("studio-1.48.0", PACKAGES, timeout_s=300) / "node_modules")
    for source, name in ((PAGE, "page.html"), (log, "play.mcap"), (layout, "play.layout.json")):
        shutil.copy(source, folder / name)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Ranged, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/page.html"
    finally:
        server.shutdown()
        server.server_close()


@contextmanager
def opened(log, layout, folder):
    """Open a log and its layout in Studio, in a browser without a sidebar; all panels of the layout are there."""
    from selenium import webdriver
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.keys import Keys

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for flag in (*FLAGS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(flag)
    count = len(json.loads(layout.read_text())["configById"])
    (folder / "page").mkdir(parents=True)
    with served(log, layout, folder / "page") as address:
        driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
        try:
            driver.get(address)
            until(driver, lambda: len(panels(driver)) == count)
            ActionChains(driver).key_down(Keys.CONTROL).send_keys("b").key_up(Keys.CONTROL).perform()
            yield driver
        finally:
            driver.quit()


def until(driver, found):
    """Return what is found, as soon as there is something."""
    from selenium.webdriver.support.wait import WebDriverWait

    return WebDriverWait(driver, PATIENCE_S, poll_frequency=1).until(lambda _: found())


def panels(driver):
    """All panels by their titles."""
    script = """
    return [...document.querySelectorAll(arguments[0])]
      .map(header => [header.innerText.split("\\n")[0].trim(), header.closest(".mosaic-tile")])
    """
    return dict(driver.execute_script(script, _HEADERS))


def colours(panel):
    """How many pixels of each class's colour a panel shows."""
    picture = np.asarray(Image.open(io.BytesIO(panel.screenshot_as_png)).convert("RGB"))
    return {each.name: int((picture == each.colour).all(axis=-1).sum()) for each in DEFAULT_CLASSES.classes}
