"""Takes a picture of a played log in Foxglove Studio, which npm provides, in headless Chromium.

Example: PYTHONPATH=.:tests python tools/viewer_picture.py play.mcap docs/viewer.png
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from support.studio import colours, opened, panels, until


def main(log: Path, picture: Path) -> None:
    """Write the picture as soon as all grids of classes are drawn."""
    with (
        TemporaryDirectory() as folder,
        opened(log, log.with_suffix(".layout.json"), Path(folder) / "viewer") as driver,
    ):
        for title, panel in panels(driver).items():
            if title.startswith(("Newest", "Target", "Prediction", "Legend")):
                until(driver, lambda panel=panel: colours(panel)["road"] > 0)
        picture.write_bytes(driver.get_screenshot_as_png())


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
