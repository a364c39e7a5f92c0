// Reads a log with the reference implementation for JavaScript and prints what it found as JSON.
import { createHash } from "node:crypto";
import { readFile } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";
import { loadDecompressHandlers, protobufFromBinaryDescriptor } from "@mcap/support";

const data = new Uint8Array(await readFile(process.argv[2]));
const decompressHandlers = await loadDecompressHandlers();

// Front to back: every checksum, that of the whole data section included.
const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
stream.append(data);
const records = {};
for (let record; (record = stream.nextRecord()); ) {
  records[record.type] = (records[record.type] ?? 0) + 1;
}

// Through the index: every message decoded by the schema that the file brings along.
const readable = {
  size: async () => BigInt(data.byteLength),
  read: async (offset, length) => data.subarray(Number(offset), Number(offset + length)),
};
const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const types = new Map();
const plain = (key, value) =>
  value instanceof Uint8Array || value?.type === "Buffer"
    ? createHash("sha256").update(Uint8Array.from(value.data ?? value)).digest("hex")
    : typeof value === "bigint" ? value.toString() : value;
const messages = [];
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const schema = reader.schemasById.get(channel.schemaId);
  if (!types.has(schema.id)) {
    types.set(schema.id, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name));
  }
  const type = types.get(schema.id);
  const value = type.toObject(type.decode(message.data), { longs: String });
  const times = { log_ns: message.logTime, publish_ns: message.publishTime };
  messages.push({ topic: channel.topic, schema: schema.name, ...times, value });
}
const attachments = {};
for await (const attachment of reader.readAttachments()) {
  attachments[attachment.name] = attachment.data;
}
const metadata = {};
for await (const entry of reader.readMetadata()) {
  metadata[entry.name] = Object.fromEntries(entry.metadata);
}
const done = stream.done() && stream.bytesRemaining() === 0;
console.log(JSON.stringify({ done, records, messages, attachments, metadata }, plain));
