"""Write the README of a report that is kept with the code: what was run, on what, by which commands, and what came out.

Example: python tools/report_readme.py build/kept/reference reports/reference "run reference --logs LOGS --out RUN"
"""

import argparse
from collections import Counter
from collections.abc import Collection
from pathlib import Path

import pandas as pd

from semgrid_eval.files import write_text
from semgrid_eval.report.claims.findings import Verdict
from semgrid_eval.report.estimates.bootstrap import Resampling, RowScores, score_everywhere
from semgrid_eval.report.page.provenance import data_sets
from semgrid_eval.report.rows.load import load_runs
from semgrid_eval.scores.metrics.table import IOU
from semgrid_eval.scores.results import ResultRecord, RunRecord, read_result, read_run, result_folder

README = """# {title}

A report made by `make {name}`; the page is [index.html](index.html).

| | |
|---|---|
{facts}

```sh
{commands}
```

## Scores

{scores}"""
DEFAULT = "-default"
"""How the names of rows end in which nothing was changed."""


def describe(run: Path, report: Path, commands: list[str]) -> str:
    """Describe a run and its report in Markdown; commands are given without the program's name."""
    record = read_run(run)
    done = [read_result(result_folder(run, name)) for name in {name for row in record.rows for name in row.results}]
    text = README.format(
        title=record.title,
        name=report.resolve().name,
        facts="\n".join(f"| {name} | {value} |" for name, value in facts(record, done).items()),
        commands="\n".join(f"semgrid-eval {command}" for command in commands),
        scores=(report / "summary.md").read_text(encoding="utf-8"),
    )
    found = {
        "The paper's claims on this run": claims(pd.read_csv(report / "findings.csv")),
        "Each choice against the default": choices(run),
    }
    return text + "".join(f"\n## {heading}\n\n{table}\n" for heading, table in found.items() if table)


def facts(record: RunRecord, done: list[ResultRecord]) -> dict[str, str]:
    """List what a run was made from and what it took."""
    splits = Counter(log.split for log in record.logs)
    failed = [row.name for row in record.rows if row.failure]
    trained = [result.train_seconds for result in done if result.train_seconds is not None]
    return {
        "recordings": ", ".join(f"{count} {split}" for split, count in sorted(splits.items())),
        "data set": ", ".join(data_sets(record)),
        "rows": f"{len(record.rows)}" + (f", failed: {', '.join(failed)}" if failed else ""),
        "trainings": f"{len(trained)}, {sum(trained) / 60:.0f} minutes in all",
        "last start": record.started,
        "machine": ", ".join(f"{name} {value}" for name, value in sorted(record.machine.items())),
        "versions": ", ".join(f"{name} {version}" for name, version in sorted(record.versions.items())),
    }


def claims(findings: pd.DataFrame) -> str:
    """Give a table of the claims that could be tested with their verdicts, nothing where there are none."""
    tested = findings[findings["verdict"] != Verdict.NOT_RUN].drop_duplicates("name")
    lines = [f"| {line.claim} | {line.verdict} |" for line in tested.itertuples()]
    return "\n".join(["| claim | verdict |", "|---|---|", *lines]) if lines else ""


def choices(run: Path) -> str:
    """Give a table of rows against those in which nothing was changed, nothing where a run has no such rows."""
    (loaded,) = load_runs([run])
    scores = score_everywhere(loaded.rows, IOU, Resampling())
    lines = []
    for name, entry in scores.items():
        usual = scores.get(default_of(name, scores))
        if usual is None or usual is entry:
            continue
        found = [_minus(entry, usual, column) for column in IOU.compared]
        lines.append(f"| {name} \N{MINUS SIGN} {usual.row.name} | {' | '.join(found)} |")
    titles = [IOU.labels[column] for column in IOU.compared]
    return "\n".join([f"| | {' | '.join(titles)} |", "|---|" + "---|" * len(titles), *lines]) if lines else ""


def default_of(name: str, names: Collection[str]) -> str:
    """Name the row that another one changes: the longest name that it begins with, or the default of its family."""
    usual = name.partition("-")[0] + DEFAULT
    begun = [other for other in names if name.startswith(f"{other}-")] if usual in names else []
    return max(begun, key=len, default=usual)


def _minus(entry: RowScores, usual: RowScores, column: str) -> str:
    """Write a paired difference; scores on other targets are not subtracted."""
    if entry.row.targets != usual.row.targets:
        return f"{entry.mean[column]:.3f}, other targets"
    difference = entry.minus(usual, column)
    return f"{difference.value:+.3f} ({difference.low:+.3f} to {difference.high:+.3f})"


def main() -> None:
    """Write README.md beside the page of a report."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    parser.add_argument("report", type=Path)
    parser.add_argument("commands", nargs="+")
    chosen = parser.parse_args()
    write_text(chosen.report / "README.md", describe(chosen.run, chosen.report, chosen.commands))


if __name__ == "__main__":
    main()
