import assert from "node:assert/strict";
import { test } from "node:test";
import { History, kWindow_s } from "../src/history";
import type { MapUpdate, Message, World } from "../src/messages";
import { decode } from "../src/protocol";
import { percentile } from "../src/statistics";
import { Track } from "../src/track";
import { encode, mapHeader, smallWorld } from "./encode";
import { randomNumbers } from "./random";

const world = decode(encode(smallWorld({ time_s: 0 })), null) as World;

function tell(header: object, ...payload: ArrayBufferView[]): Message {
  return decode(encode(header, ...payload), world);
}

function state(time_s: number): Message {
  const header = { kind: "state", time_s, status: "moving", q: [time_s], true_q: null, clearance: null };
  return tell(header, new Float32Array(21));
}

function plan(time_s: number, role = "followed"): Message {
  return tell({ kind: "plan", time_s, role, start_s: time_s, times_s: [], swept_s: [] });
}

function event(time_s: number, name = "planned"): Message {
  return tell({ kind: "event", time_s, event: name, solve_ms: 1 });
}

function map(time_s: number, full: boolean, blocks: Record<number, number>, changes: object = {}): MapUpdate {
  const indices = Object.keys(blocks).map(Number);
  const data = new Uint8Array(1024 * indices.length);
  indices.forEach((index, i) => data.fill(blocks[index], 1024 * i, 1024 * (i + 1)));
  return tell(mapHeader({ time_s, full, blocks: indices, ...changes }), data) as MapUpdate;
}

test("a moment is what had been told by then", () => {
  const history = new History(world);
  for (const time of [1, 2, 3]) history.add(state(time));
  history.add(plan(1.5));
  history.add(plan(2.5, "refused"));
  history.add(plan(2.8));
  history.add(tell({ kind: "end", time_s: 3, success: true, verdict: "reached" }));
  assert.equal(history.at(0.5).state, null);
  assert.deepEqual(history.at(2.99).state?.q, [2]);
  assert.equal(history.at(2).previous, null);
  assert.equal(history.at(2.6).refused?.time_s, 2.5);
  assert.equal(history.at(2.9).refused, null, "a later plan is followed");
  assert.equal(history.at(2.9).previous?.time_s, 1.5);
  assert.equal(history.at(2.9).end, null);
  assert.equal(history.at(3).end?.verdict, "reached");
});

test("whoever comes late knows nothing of before", () => {
  const history = new History(world);
  history.add(world);
  history.add(map(40, true, { 0: 1 }));
  history.add(plan(12));
  history.add(event(12));
  history.add(state(40.5));
  assert.equal(history.first_s, 40);
  assert.equal(history.at(40).followed?.time_s, 12);
});

test("of a live run the last minute is kept, of a recording all", () => {
  const recording = decode(encode(smallWorld({ time_s: 0, recorded: true })), null) as World;
  const [live, recorded] = [new History(world), new History(recording)];
  for (const history of [live, recorded]) {
    history.add(plan(0.25));
    for (let time = 0.5; time <= 200; time += 0.5) history.add(state(time));
    history.add(event(199));
  }
  assert.ok(live.first_s >= 200 - kWindow_s - 1 && live.first_s <= 200 - kWindow_s);
  assert.equal(live.at(live.first_s).state?.time_s, live.first_s, "what held at the window's start stays");
  assert.equal(live.at(200).followed?.time_s, 0.25, "what is still followed stays, however old");
  assert.ok(live.states.items.length <= 2 * (kWindow_s + 2));
  assert.equal(recorded.first_s, 0.5);
  assert.equal(recorded.states.items.length, 400);
});

test("what is told again after a lost connection is known", () => {
  const history = new History(world);
  history.add(state(1));
  history.add(event(1));
  history.add(event(1, "recovered"));
  history.add(state(1));
  history.add(event(1));
  assert.equal(history.states.items.length, 1);
  assert.equal(history.events.items.length, 2);
  const timing = { kind: "timing", time_s: 1, frames: [[1, 1, 1, 1, 1]], steps: [[1, 1]], checks: 1, frames_dropped: 0 };
  history.add(tell(timing));
  history.add(tell({ ...timing, time_s: 2 }));
  assert.equal(history.frameTimings.items.length, 1);
  assert.ok(history.continues(decode(encode(smallWorld({ time_s: 5 })), null) as World));
  assert.ok(!history.continues(decode(encode(smallWorld({ time_s: 5, episode: 3 })), null) as World));
  history.add(state(20));
  assert.ok(!history.continues(decode(encode(smallWorld({ time_s: 2 })), null) as World), "the same run, begun anew");
  assert.ok(history.isFromBefore(state(2)) && !history.isFromBefore(state(19.5)) && !history.isFromBefore(event(2)));
});

test("the map at any kept time is that of all updates up to it, applied one by one", () => {
  const random = randomNumbers(11);
  const history = new History(world);
  const snapshots: { time_s: number; blocks: Map<number, number> }[] = [];
  let blocks = new Map<number, number>();
  for (let time = 1; time <= 90; ++time) {
    const full = random() < 0.1 || time === 1;
    const told: Record<number, number> = {};
    for (let i = 0; i < 3; ++i) told[Math.floor(random() * 6)] = 1 + Math.floor(random() * 3);
    blocks = new Map(full ? [] : blocks);
    for (const [block, value] of Object.entries(told)) blocks.set(Number(block), value);
    history.add(map(time, full, told));
    snapshots.push({ time_s: time, blocks });
  }
  const kept = snapshots.filter((snapshot) => snapshot.time_s >= history.first_s);
  assert.ok(kept.length >= 60 && kept.length < 64);
  for (const { time_s, blocks: expected } of kept) {
    const epoch = history.map.at(time_s + 0.5);
    assert.ok(epoch !== null);
    for (let block = 0; block < 6; ++block) {
      assert.equal(epoch.block(block, time_s + 0.5)?.[77], expected.get(block), `block ${block} at ${time_s}`);
    }
  }
  for (const [a, b] of [[0, 1], [5, 40], [40, 5]].map(([i, j]) => [kept[i], kept[j]])) {
    const changed = history.map.at(90)?.changedBetween(a.time_s, b.time_s);
    for (let block = 0; block < 6; ++block) {
      if (a.blocks.get(block) !== b.blocks.get(block)) assert.ok(changed?.has(block));
    }
  }
  // Versions are counted: blocks that are kept are at least one a change, at most one an update.
  assert.ok(history.map.bytes > 60 * 1024 && history.map.bytes < 64 * 3 * 1024);
});

test("a block that is told again as it was is not kept twice", () => {
  const history = new History(world);
  history.add(map(1, true, { 0: 1, 1: 2 }));
  history.add(map(2, false, { 0: 1 }));
  history.add(map(3, true, { 0: 1, 1: 2 }));
  assert.equal(history.map.bytes, 2048);
  assert.deepEqual([...(history.map.at(3)?.changedBetween(1, 3) ?? [])], []);
});

test("a grid that moves begins a map anew; updates for a grid nobody told of are left out", () => {
  const history = new History(world);
  history.add(map(1, true, { 0: 1 }));
  history.add(map(2, false, { 0: 2 }, { origin_m: [0, 0, 0] }));
  assert.equal(history.map.at(2)?.block(0, 2)?.[0], 1);
  history.add(map(3, true, { 0: 3 }, { origin_m: [0, 0, 0] }));
  assert.notEqual(history.map.at(3), history.map.at(2));
  assert.equal(history.map.at(3)?.block(0, 3)?.[0], 3);
  assert.equal(history.map.at(2.9)?.block(0, 2.9)?.[0], 1);
});

test("beyond its budget a history grows shorter, not larger", () => {
  const budgets = { map_bytes: 40 * 1024, frame_bytes: 4000, slice_bytes: 1000 };
  const history = new History(world, budgets);
  const camera = { width_px: 20, height_px: 10, fx_px: 9, fy_px: 9, cx_px: 10, cy_px: 5 };
  const frame = { kind: "frame", stamp_s: 0, pose: [0, 0, 0, 0, 0, 0, 1], camera, columns: 20, rows: 10 };
  for (let time = 1; time <= 50; ++time) {
    history.add(map(time, time === 1, { 0: time, 1: time, 2: time, 3: time }));
    history.add(tell({ ...frame, time_s: time }, new Uint16Array(200)));
  }
  assert.ok(history.map.bytes <= budgets.map_bytes + 8 * 1024);
  assert.ok(history.frames.bytes <= budgets.frame_bytes + 400);
  assert.ok(history.first_s > 38);
  assert.equal(history.map.at(50)?.block(0, 50)?.[0], 50);
});

test("a track finds what holds at, before and after a time", () => {
  const random = randomNumbers(5);
  const track = new Track<{ time_s: number }>();
  const times: number[] = [];
  for (let i = 0; i < 200; ++i) {
    const time_s = Math.floor(random() * 50);
    times.push(time_s);
    track.add({ time_s });
  }
  times.sort((a, b) => a - b);
  assert.deepEqual(track.items.map((item) => item.time_s), times);
  for (let time = -1; time <= 51; time += 0.5) {
    assert.equal(track.at(time)?.time_s, times.filter((one) => one <= time).pop());
    assert.equal(track.after(time)?.time_s, times.find((one) => one > time));
    assert.equal(track.before(time)?.time_s, times.filter((one) => one < time).pop());
  }
});

test("percentiles are of the nearest rank", () => {
  const values = Array.from({ length: 100 }, (_, i) => 100 - i);
  assert.equal(percentile(values, 0.5), 50);
  assert.equal(percentile(values, 0.95), 95);
  assert.equal(percentile([3], 0.5), 3);
  assert.equal(percentile([], 0.5), null);
});
