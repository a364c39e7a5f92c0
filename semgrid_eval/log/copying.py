"""Copy records of one MCAP file to another, which numbers its channels itself."""

from collections import Counter
from collections.abc import Iterable
from typing import BinaryIO

from mcap import records

from semgrid_eval.log.writer import LIBRARY, open_writer


class Definitions:
    """Schemas and channels by their numbers; of two with one number, the first counts."""

    def __init__(self) -> None:
        self.schemas: dict[int, records.Schema] = {}
        self.channels: dict[int, records.Channel] = {}

    def add(self, found: Iterable[records.McapRecord], *, replace: bool = False) -> None:
        """Take the schemas and channels among records; `replace` lets a later one with the same number count."""
        for record in found:
            for kind, known in ((records.Schema, self.schemas), (records.Channel, self.channels)):
                if isinstance(record, kind) and (replace or record.id not in known):
                    known[record.id] = record  # type: ignore[assignment]


class Copier:
    """Writes records as they were, but for the numbers of schemas and channels; `saved` counts messages by topic."""

    def __init__(self, stream: BinaryIO, definitions: Definitions) -> None:
        self._writer = open_writer(stream)
        self._writer.start(profile="", library=LIBRARY)
        self._definitions = definitions
        self._schemas: dict[tuple[object, ...], int] = {}
        self._channels: dict[tuple[object, ...], int] = {}
        self.saved: Counter[str] = Counter()

    @property
    def topics(self) -> dict[int, str]:
        """Return the topics of channels by the numbers that messages give."""
        return {number: channel.topic for number, channel in self._definitions.channels.items()}

    def define(self, found: Iterable[records.McapRecord]) -> None:
        """Take the schemas and channels that a chunk defines, which count from here on."""
        self._definitions.add(found, replace=True)

    def message(self, message: records.Message) -> bool:
        """Write a message; False where its channel is not known, so that nobody could read it."""
        channel = self._definitions.channels.get(message.channel_id)
        number = None if channel is None else self._channel(channel)
        if channel is None or number is None:
            return False
        self._writer.add_message(number, message.log_time, message.data, message.publish_time, message.sequence)
        self.saved[channel.topic] += 1
        return True

    def attachment(self, found: records.Attachment) -> None:
        """Write an attachment."""
        self._writer.add_attachment(found.create_time, found.log_time, found.name, found.media_type, found.data)

    def metadata(self, name: str, entries: dict[str, str]) -> None:
        """Write a metadata record."""
        self._writer.add_metadata(name, entries)

    def end_chunk(self) -> None:
        """Begin a new chunk, as the file that is copied did."""
        self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self) -> None:
        """Write the index."""
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _channel(self, channel: records.Channel) -> int | None:
        schema = self._schema(channel.schema_id)
        if schema is None:
            return None
        key = (channel.topic, channel.message_encoding, schema, tuple(sorted(channel.metadata.items())))
        if key not in self._channels:
            made = self._writer.register_channel(channel.topic, channel.message_encoding, schema, channel.metadata)
            self._channels[key] = made
        return self._channels[key]

    def _schema(self, number: int) -> int | None:
        if number == 0:  # of channels without one
            return 0
        schema = self._definitions.schemas.get(number)
        if schema is None:
            return None
        key = (schema.name, schema.encoding, schema.data)
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(*key)
        return self._schemas[key]
