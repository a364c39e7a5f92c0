"""Bad contracts for recordings."""

from pathlib import Path

from support.bad.case import Kind, lines, table
from support.bad.matrices import file_text

CHECK = "check logs --spec spec.yaml"
TEXTS = r"""
[a]
just words
topic: {}
checksums: fatal
cameras: 3
cameras: {}
cameras: {low: one}
cameras: {low: 3, high: 2}
cameras: {hihg: 3}
cameras: {low: 1, severity: fatal}
cameras: {low: 1e999}
duration_s: [1, 2]
largest_label_id: {low: 0, hi: 33}
topics: [/a]
topics: {/a: 3}
topics: {/a: {rate: {low: 10}}}
topics: {/a: {rate_hz: {low: fast}}}
topics: {/a: {type: 3}}
topics: {/a: {gap_s: 0.1}}
topics: {/a: {missing_beside: {high: 0}}}
topics: {/a: {uncovered_s: {topic: /b}}}
topics: {/ego/motion: {values: {sped: {low: 1}}}}
topics: {/ego/motion: {values: {speed_mps: 3}}}
topics: {/other: {values: {speed_mps: {low: 1}}}}
topics: {"/camera/{mono}/image": {messages: {low: 1}}}
latencies: {topic: /a}
latencies: [{topic: /a}]
latencies: [{seconds: {high: 1}}]
latencies: [{topic: /a, clock: sun, seconds: {high: 1}}]
latencies: [{topic: /a, after_clock: sun, seconds: {high: 1}}]
latencies: [{topic: /a, seconds: {}}]
latencies: [
"""
CONTENTS = {line: file_text(line) for line in lines(TEXTS)}


def whole() -> None:
    """Make a folder with a log, which no bad contract gets as far as to read."""
    Path("logs").mkdir()
    Path("logs/empty.mcap").touch()


CONTRACT = Kind(
    "Contracts", f"What `spec.yaml` holds in `{CHECK}`.", whole, table(CHECK, "spec.yaml", CONTENTS), shows_code=True
)
