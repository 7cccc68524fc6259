// Reads a recording with @foxglove/rosbag and holds it against what `rosbag` said of it.
//
//   node check_foxglove.mjs BAG COUNTS
//
// COUNTS: JSON, {topic: {type, count}}, as check_rosbag.py writes it where there is a rosbag.
import assert from "node:assert/strict";
import { existsSync, readFileSync } from "node:fs";
import { Bag } from "@foxglove/rosbag";
import { FileReader } from "@foxglove/rosbag/node.js";

const [file, countsFile] = process.argv.slice(2);
const expected = existsSync(countsFile) ? JSON.parse(readFileSync(countsFile, "utf8")) : null;

const bag = new Bag(new FileReader(file));
await bag.open();
const types = {};
for (const { topic, type } of bag.connections.values()) types[topic] = type;

const counts = {};
const last = {};
let before = { sec: 0, nsec: 0 };
for await (const { topic, message, timestamp } of bag.messageIterator()) {
  counts[topic] = (counts[topic] ?? 0) + 1;
  last[topic] = message;
  const { sec, nsec } = timestamp;
  assert(sec > before.sec || (sec === before.sec && nsec >= before.nsec), "times go back");
  before = timestamp;
}
for (const [topic, { type, count }] of Object.entries(expected ?? {})) {
  assert.equal(types[topic], type, topic);
  assert.equal(counts[topic], count, topic);
}
if (expected) assert.deepEqual(Object.keys(counts).sort(), Object.keys(expected).sort());

const image = last["/camera/depth/image_rect"];
const bytes = { "16UC1": 2, "32FC1": 4 }[image.encoding];
assert.equal(image.data.length, image.width * image.height * bytes);
assert.equal(last["/camera/depth/camera_info"].K[8], 1);
assert.equal(JSON.parse(last["/sidestep/events"].data).event, "recorded");
const state = last["/joint_states"];
assert.equal(state.name.length, state.position.length);
const cubes = last["/sidestep/map"].markers[1];
assert.equal(cubes.type, 6);
assert(cubes.points.length > 0 && Number.isFinite(cubes.points[0].x));
console.log(`${Object.values(counts).reduce((a, b) => a + b)} messages, ${Object.keys(counts).length} topics`);
