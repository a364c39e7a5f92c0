"""What a log says of itself as a whole, kept in its metadata record `semgrid.scene`."""

import json
from dataclasses import dataclass
from pathlib import PurePath

from semgrid_eval.classes import CLASS_NAMES
from semgrid_eval.files import digest_value

RECORD = "semgrid.scene"
FORMAT_VERSION = 1


@dataclass(frozen=True)
class Scene:
    """A log's name, origin and cameras."""

    name: str  # unique in its data set
    dataset: str  # where the recording comes from: `cityscapes` or `synthetic`
    split: str  # `train`, `val` or `test`
    cameras: tuple[str, ...]  # their names, sorted
    source_digest: str  # digest of everything that determined the content
    class_names: tuple[str, ...] = CLASS_NAMES  # the grid classes when the log was written
    group: str = ""  # the town, city or drive that it belongs to; empty where the log does not say

    def to_metadata(self) -> dict[str, str]:
        """Return the entries of the metadata record, with a digest of their own: MCAP has no checksum for them."""
        entries = {
            "format_version": str(FORMAT_VERSION),
            "name": self.name,
            "dataset": self.dataset,
            "split": self.split,
            "cameras": json.dumps(self.cameras),
            "source_digest": self.source_digest,
            "class_names": json.dumps(self.class_names),
            **({"group": self.group} if self.group else {}),
        }
        return {**entries, "digest": digest_value(entries)}

    @classmethod
    def from_metadata(cls, entries: dict[str, str]) -> "Scene":
        """Read the entries of the metadata record.

        Raises:
            ValueError: they are damaged, incomplete or of another format version.
        """
        given = {key: value for key, value in entries.items() if key != "digest"}
        if entries.get("digest") != digest_value(given):
            raise ValueError(f"metadata {RECORD} does not match its digest")
        if given.get("format_version") != str(FORMAT_VERSION):
            raise ValueError(f"its format version is {given.get('format_version')}; {FORMAT_VERSION} can be read")
        for key in ("name", "split"):
            if given[key] in ("", "..") or PurePath(given[key]).name != given[key]:
                raise ValueError(f"its {key} {given[key]!r} is not a file name")
        return cls(
            name=given["name"],
            dataset=given["dataset"],
            split=given["split"],
            cameras=tuple(json.loads(given["cameras"])),
            source_digest=given["source_digest"],
            class_names=tuple(json.loads(given["class_names"])),
            group=given.get("group", ""),
        )
