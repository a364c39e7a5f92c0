"""Logs to be checked, of a plain drive about which nothing is odd but what a test changes."""

from dataclasses import replace

from support.driving import driving

from semgrid_eval.log.check import check_log
from semgrid_eval.log.store import write_log


def smooth(change=lambda number, moment: moment, frames=8):
    """Moments of a plain drive, each changed by `change`."""
    full = next(driving().moments()).cameras["front"]
    for number, moment in enumerate(driving(frames=frames).moments()):
        sample = replace(moment.motion[0], speed_mps=8.0, yaw_rate_radps=0.1)
        frame = replace(full, stamp_ns=moment.stamp_ns)
        yield change(number, replace(moment, motion=(sample,), cameras={"front": frame}))


def findings(tmp_path, change=lambda number, moment: moment, **changes):
    path = tmp_path / "log.mcap"
    write_log(replace(driving(), moments=lambda: smooth(change), **changes), path)
    report = check_log(path)
    return {finding.place: (finding.severity, finding.message) for finding in report.findings}


def with_frame(moment, **changes):
    return replace(moment, cameras={"front": replace(moment.cameras["front"], **changes)})
