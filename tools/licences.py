"""List name, version and licence of all packages that semgrid-eval needs; fail on one that is not known to be fine.

It reads what is installed beside it: dependencies of dependencies, and extras where they are installed. A licence is
fine if one may use the package with a program under Apache-2.0: it is permissive, or asks something of changes to the
package's own files alone.

Example: python tools/licences.py
"""

import re
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from typing import NamedTuple

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = "semgrid-eval"
FINE = {
    *("0BSD", "Apache-2.0", "BSD", "BSD-2-Clause", "BSD-3-Clause", "BSL-1.0", "CC0-1.0", "HPND", "ISC", "MIT"),
    *("MIT-0", "MIT-CMU", "PSF-2.0", "Python-2.0", "Unlicense", "Zlib"),
    *("MPL-2.0", "EPL-2.0"),  # of files, which are used as they are
    "Apache-2.0 WITH LLVM-exception",
    "any-OSI",  # whichever one chooses
}
"""SPDX identifiers; `BSD` where a package does not say which."""
_CUDA = "not open source; of CUDA, which PyTorch's packages for GPUs bring along"
REMARKS = {"nvidia-": _CUDA, "cuda-": _CUDA}
"""Beginnings of names that are fine for another reason."""
WORDS = (
    (r"Apache.*(2\.0|Software License)|^Apache.?2$", "Apache-2.0"),
    (r"(3-Clause|New|Modified|Revised).*BSD|BSD.*(3-Clause|New)|BSD-3", "BSD-3-Clause"),
    (r"2-Clause|Simplified BSD|BSD-2", "BSD-2-Clause"),
    (r"\bBSD\b", "BSD"),
    (r"\bMIT-CMU\b|\bHPND\b", "HPND"),
    (r"\bMIT\b", "MIT"),
    (r"Mozilla Public License 2\.0|MPL.?2", "MPL-2.0"),
    (r"Python Software Foundation|PSF", "PSF-2.0"),
    (r"\bISC\b", "ISC"),
    (r"Eclipse Public License.*2|EPL.*2", "EPL-2.0"),
    (r"zlib", "Zlib"),
    (r"Unlicense", "Unlicense"),
    (r"CC0", "CC0-1.0"),
    (r"Redistribution and use in source and binary forms", "BSD"),  # the text itself
    (r"Permission is hereby granted, free of charge", "MIT"),
)
"""What packages of before 2024 write in words, and its SPDX identifier."""
_SHOWN = 60


class Entry(NamedTuple):
    """One package; `fault` is empty where its licence is fine."""

    name: str
    version: str
    licence: str
    fault: str

    def __str__(self) -> str:
        remark = f"  <- {self.fault}" if self.fault else ""
        return f"{self.name:<36}{self.version:<22}{self.licence}{remark}"


def needed(root: str = ROOT) -> dict[str, Distribution]:
    """Find a package's dependencies that are installed, with its extras, and theirs, by canonical name."""
    found: dict[str, Distribution] = {}
    pending = [(canonicalize_name(root), extra) for extra in ("", *_extras(root))]
    seen = set(pending)
    while pending:
        name, extra = pending.pop()
        try:
            found[name] = distribution(name)
        except PackageNotFoundError:  # of an extra, or another system
            continue
        for requirement in _requirements(found[name], extra):
            for wanted in ("", *requirement.extras):
                each = canonicalize_name(requirement.name), wanted
                if each not in seen:
                    seen.add(each)
                    pending.append(each)
    found.pop(canonicalize_name(root), None)
    return dict(sorted(found.items()))


def entry(name: str, package: Distribution) -> Entry:
    """Say what a package's licence is, and whether it is fine."""
    licence = licence_of(package)
    remark = next((text for start, text in REMARKS.items() if name.startswith(start)), None)
    if remark is not None:
        return Entry(name, package.version, f"{licence} ({remark})", "")
    return Entry(name, package.version, licence, "" if is_fine(licence) else "not known to be fine")


def licence_of(package: Distribution) -> str:
    """Return a package's licence as an SPDX expression where it can be told, else its own words."""
    if expression := _field(package, "License-Expression"):
        return expression
    classifiers = [each for each in package.metadata.get_all("Classifier") or () if each.startswith("License ::")]
    given = [each.rpartition(" :: ")[2] for each in classifiers if each != "License :: OSI Approved"]
    written = _field(package, "License")
    exact = _identifier(written) if len(written) <= _SHOWN else None
    told = [_identifier(each) or each for each in given]
    if exact and (not told or "BSD" in told):  # a classifier does not say which BSD licence
        return exact
    if told:
        return " OR ".join(dict.fromkeys(told)) if len(told) > 1 else told[0]
    return exact or _identifier(written) or (written.splitlines() or ["unknown"])[0][:_SHOWN]


def is_fine(expression: str) -> bool:
    """Tell whether an SPDX expression can be met by licences that are fine: one side of OR, all of AND."""
    text = expression.strip()
    if text in FINE:
        return True
    for operator, decide in ((" OR ", any), (" AND ", all)):
        parts = _split(text, operator)
        if len(parts) > 1:
            return bool(decide(is_fine(part) for part in parts))
    inner = text[1:-1]
    return text.startswith("(") and text.endswith(")") and is_fine(inner)


def _split(text: str, operator: str) -> list[str]:
    """Split at an operator outside brackets."""
    parts, depth = [""], 0
    for piece in re.split(rf"({operator}|[()])", text, flags=re.IGNORECASE):
        depth += (piece == "(") - (piece == ")")
        if depth == 0 and piece.upper() == operator:
            parts.append("")
        else:
            parts[-1] += piece
    return parts


def _field(package: Distribution, name: str) -> str:
    return str((package.metadata.get_all(name) or [""])[0]).strip()


def _identifier(text: str) -> str | None:
    text = " ".join(text.split())
    if text in FINE:
        return text
    if re.search(r"GPL|General Public", text):
        return None
    return next((name for pattern, name in WORDS if re.search(pattern, text, re.IGNORECASE)), None)


def _extras(root: str) -> list[str]:
    return distribution(root).metadata.get_all("Provides-Extra") or []


def _requirements(package: Distribution, extra: str) -> Iterator[Requirement]:
    for line in package.requires or ():
        requirement = Requirement(line)
        if requirement.marker is None or requirement.marker.evaluate({"extra": extra}):
            yield requirement


def main() -> int:
    """Print all; the exit code is 1 if there is a package whose licence is not known to be fine."""
    entries = [entry(name, package) for name, package in needed().items()]
    sys.stdout.writelines(f"{each}\n" for each in entries)
    faults = [each for each in entries if each.fault]
    sys.stdout.write(f"{len(entries)} packages, {len(faults)} with a licence that is not known to be fine\n")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
