"""The commands of a page, run one after the other with less data and fewer rows where that is said here."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

from support.commands import run_command
from support.pages import ROOT, commands, text_of
from support.toy_world import street

from semgrid_eval.log.store import write_log

TOWN = (
    "--recordings 2 --towns 2 --val-towns 1 --val-share 0.5 --town-size-m 250 --duration-s 15 --width 128 --height 64"
)
LESS = {
    "convert synthetic drives": f"{TOWN} --cache towns --workers 1 --frames 30",
    "convert synthetic": f"{TOWN} --cache towns --workers 1",
    "latency": "--frames 6 --warm-up 2",
    "run paper-cpu": "--row BL-DC --row BL-Fuse --jobs 1",
    "run real": "--row BL-DC --jobs 1",
    "run remedies": "--row 'BL-*' --jobs 1",
    "run disturb": "--row 'BL-DC*' --jobs 1",
    "run stream-cpu": "--row 'newest +0' --row 'BL-Fuse +40' --row 'RN-town +0' --jobs 1",
    "run baselines --model": "--row Mine --row BL-DC",
}
"""What is said last holds: options behind those of a page."""
FINDINGS = {"check logs --spec recording.yaml --strict": 1}
"""Commands that are to find something, with their exit code: recordings of 1.7 s are too short for that contract."""


def run(page, but=None, instead=None):
    """Run a page's commands, but for what installs and the command that begins with `but`.

    Where a word is one of `instead`, what stands there takes its place.
    """
    for line in commands(text_of(page)):
        program, _, rest = line.partition(" ")
        if but and rest.startswith(but):
            continue
        for word, other in (instead or {}).items():
            rest = re.sub(rf"(?<!\S){re.escape(word)}(?!\S)", other, rest)
        less = next((options for start, options in LESS.items() if rest.startswith(start)), "")
        words = [part for word in shlex.split(rest) for part in (sorted(map(str, Path().glob(word))) or [word])]
        if program == "semgrid-eval":
            ended = run_command(words + shlex.split(less))
            assert ended.code == FINDINGS.get(rest, 0), f"{line}\n{ended.err}"
        elif program == "python" and rest.startswith("tools/"):
            subprocess.run([sys.executable, ROOT / words[0], *words[1:]], check=True)


def toy_logs(folder, splits=("train", "val")):
    for number, split in enumerate(splits):
        world = street(number, frames=30, speed_mps=8.0, noise_px=0.05)
        write_log(world.recording(f"toy_{number:06}_000000", split), Path(folder) / split / f"toy{number}.mcap")
