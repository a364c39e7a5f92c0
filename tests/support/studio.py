"""Foxglove Studio 1.48 in headless Chromium: the last version whose code is public, from its package on npm."""

import os
import re
import shutil
import subprocess
import tempfile
import threading
from contextlib import contextmanager, suppress
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

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
    "--window-size=1600,1000",
)


def require_viewers():
    """Skip a test that downloads a viewer, unless viewers are asked for."""
    if not os.environ.get(ASKED):
        pytest.skip(f"viewers are some 60 MB from npm and take a minute: set {ASKED}=1 to test with them")


def packages():
    """The folder of the installed packages, kept between runs; skips the test where they cannot be had."""
    if shutil.which("npm") is None:
        pytest.skip("npm is needed to get Foxglove Studio")
    folder = Path(tempfile.gettempdir()) / f"semgrid-eval-studio-{os.getuid()}-1.48.0"
    if not folder.is_dir():
        with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
            _install(Path(scratch) / "studio")
            with suppress(OSError):  # another process was faster
                (Path(scratch) / "studio").rename(folder)
    return folder / "node_modules"


def _install(folder):
    folder.mkdir()
    quiet = ("--no-audit", "--no-fund", "--ignore-scripts", "--legacy-peer-deps", "--fetch-retries=0")
    try:
        command = ["npm", "install", "--prefix", str(folder), *quiet, *PACKAGES]
        subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    except subprocess.SubprocessError as error:
        reason = str(getattr(error, "stderr", None) or error).splitlines()[0]
        pytest.skip(f"npm cannot install {' and '.join(PACKAGES)} here: {reason}")


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
    (folder / "node_modules").symlink_to(packages())
    for source, name in ((PAGE, "page.html"), (log, "play.mcap"), (layout, "play.layout.json")):
        shutil.copy(source, folder / name)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Ranged, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/page.html"
    finally:
        server.shutdown()
        server.server_close()
