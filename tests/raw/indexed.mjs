// Reads raw captures by the indexed reader of `@mcap/core`, which refuses a file without a summary, and decodes each
// message by the descriptor in the file with protobufjs.
//
// usage: node indexed.mjs PACKAGES FILE.mcap...
//
// PACKAGES is a folder with `node_modules`. Prints a line for each file: messages by topic.

import { createRequire } from "node:module";
import { open } from "node:fs/promises";
import { pathToFileURL } from "node:url";

const [packages, ...files] = process.argv.slice(2);
const require = createRequire(pathToFileURL(`${packages}/indexed.mjs`));
const { McapIndexedReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { loadDecompressHandlers, protobufFromBinaryDescriptor } = require("@mcap/support");

const decompressHandlers = await loadDecompressHandlers();
for (const file of files) {
  const handle = await open(file, "r");
  const reader = await McapIndexedReader.Initialize({ readable: new FileHandleReadable(handle), decompressHandlers });
  const types = new Map();
  for (const channel of reader.channelsById.values()) {
    const schema = reader.schemasById.get(channel.schemaId);
    types.set(channel.id, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name));
  }
  const topics = {};
  for await (const message of reader.readMessages()) {
    const { topic } = reader.channelsById.get(message.channelId);
    topics[topic] = (topics[topic] ?? 0) + 1;
    const fields = types.get(message.channelId).decode(message.data);
    if (topic === "/imu" && !Object.hasOwn(fields, "gyro_x")) {
      throw new Error(`${file}: a sample without gyro_x`);
    }
  }
  const sorted = Object.fromEntries(Object.entries(topics).sort());
  console.log(JSON.stringify({ file, ...sorted }));
  await handle.close();
}
