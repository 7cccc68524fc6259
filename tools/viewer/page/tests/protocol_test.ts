import assert from "node:assert/strict";
import { test } from "node:test";
import type { World } from "../src/messages";
import { decode, ProtocolError } from "../src/protocol";
import { encode, mapHeader, smallWorld } from "./encode";

const world = decode(encode(smallWorld()), null) as World;

function refuses(buffer: ArrayBuffer, what: RegExp, known: World | null = world): void {
  assert.throws(
    () => decode(buffer, known),
    (error: unknown) => error instanceof ProtocolError && what.test(error.message),
  );
}

test("a world is read whole", () => {
  assert.equal(world.title, "Small");
  assert.equal(world.recorded, false);
  assert.deepEqual(world.links, ["base", "hand"]);
  assert.equal(world.toolLink, 1);
  assert.deepEqual(world.shapes[0].shape, { type: "cylinder", radius_m: 0.2, length_m: 0.3 });
  const mesh = world.shapes[1].shape;
  assert.ok(mesh.type === "mesh");
  assert.deepEqual([...mesh.triangles], [0, 1, 2]);
  assert.equal(world.objects[1].moves, true);
});

test("a world of the same episode is known again, whatever its time", () => {
  const later = decode(encode(smallWorld({ time_s: 9 })), null) as World;
  const other = decode(encode(smallWorld({ episode: 1 })), null) as World;
  assert.equal(later.identity, world.identity);
  assert.notEqual(other.identity, world.identity);
});

test("headers of every length modulo 4 keep the payload aligned", () => {
  for (const title of ["", "a", "ab", "abc", "\u00e9"]) {
    const poses = Float32Array.from({ length: 21 }, (_, i) => i);
    const header = { kind: "state", time_s: 3, status: "moving", q: [0.1], true_q: null, clearance: null, title };
    const state = decode(encode(header, poses), world);
    assert.ok(state.kind === "state");
    assert.deepEqual([...state.poses], [...poses]);
  }
});

test("a state has the poses of all links and of what moves", () => {
  const header = {
    kind: "state",
    time_s: 3,
    status: "moving",
    q: [0.1],
    true_q: [0.2],
    clearance: { distance_m: 0.4, link: "hand", object: "table", point_m: [1, 2, 3] },
  };
  const state = decode(encode(header, new Float32Array(21)), world);
  assert.ok(state.kind === "state");
  assert.deepEqual(state.clearance, { distance_m: 0.4, link: "hand", object: "table", point_m: [1, 2, 3] });
  refuses(encode(header, new Float32Array(14)), /payload has 56 bytes, at least 84/);
  refuses(encode(header, new Float32Array(28)), /28 bytes are left over/);
  refuses(encode(header, new Float32Array(21).fill(NaN)), /not finite/);
});

test("tracks and predictions are read whole", () => {
  const track = { id: 4, position_m: [1, 2], velocity_mps: [0.5, -1], radius_m: 0.3, bottom_m: 0, top_m: 1.7 };
  const set = { track: 4, likelihood: 0.5, bottom_m: 0, top_m: 1.7, knots: [[3, 1, 2, 0.3], [5, 2, 0, 0.7]] };
  const header = { kind: "tracks", time_s: 3, tracks: [track], sets: [set] };
  const told = decode(encode(header), world);
  assert.ok(told.kind === "tracks");
  assert.deepEqual(told.tracks, [track]);
  assert.deepEqual(told.sets[0].knots[1], { time_s: 5, centre_m: [2, 0], radius_m: 0.7 });
  refuses(encode({ ...header, sets: [{ ...set, knots: [[3, 1, 2]] }] }), /knots\[0\] has 3 numbers, not 4/);
  refuses(encode({ ...header, tracks: [{ ...track, position_m: [1] }] }), /position_m has 1 numbers, not 2/);
});

test("a map names blocks that are in its grid", () => {
  const data = new Uint8Array(2048).map((_, i) => i % 251);
  const map = decode(encode(mapHeader(), data), world);
  assert.ok(map.kind === "map");
  assert.deepEqual(map.blocks, [0, 5]);
  assert.deepEqual([...map.data], [...data]);
  // 40 x 32 x 16 voxels are 3 x 2 x 1 blocks.
  refuses(encode(mapHeader({ blocks: [6] }), new Uint8Array(1024)), /no block 6 among 6/);
  refuses(encode(mapHeader({ blocks: [-1] }), new Uint8Array(1024)), /no block -1/);
  refuses(encode(mapHeader({ blocks: [0.5] }), new Uint8Array(1024)), /no block 0.5/);
  refuses(encode(mapHeader({ size_vox: [40, 0, 16] }), data), /size_vox has 0/);
  refuses(encode(mapHeader({ voxel_m: 0 }), data), /voxel_m is not positive/);
  refuses(encode(mapHeader(), new Uint8Array(1024)), /at least 2048/);
});

test("depth, plans and slices have as many numbers as they say", () => {
  const camera = { width_px: 640, height_px: 480, fx_px: 500, fy_px: 500, cx_px: 320, cy_px: 240 };
  const frame = { kind: "frame", time_s: 3, stamp_s: 3, pose: [0, 0, 0, 0, 0, 0, 1], camera, columns: 3, rows: 2 };
  const depth = decode(encode(frame, Uint16Array.of(1, 2, 3, 4, 5, 65535)), world);
  assert.ok(depth.kind === "frame");
  assert.deepEqual([...depth.depth_mm], [1, 2, 3, 4, 5, 65535]);
  refuses(encode({ ...frame, columns: 1e6 }), /columns is 1000000/);

  const plan = { kind: "plan", time_s: 3, role: "followed", start_s: 3, times_s: [0, 1], swept_s: [0] };
  const numbers = Float32Array.from({ length: 26 }, (_, i) => i);
  const read = decode(encode(plan, numbers), world);
  assert.ok(read.kind === "plan");
  assert.deepEqual([...read.toolPath], [0, 1, 2, 3, 4, 5]);
  assert.deepEqual([...read.basePath], [6, 7, 8, 9, 10, 11]);
  assert.equal(read.sweptPoses.length, 14);
  assert.equal(read.sweptPoses[0], 12);
  refuses(encode({ ...plan, role: "wished" }, numbers), /role is "wished"/);

  const slice = {
    ...{ kind: "slice", time_s: 3, stamp_s: 3, axis: "z", position_m: 0.5, first_m: [0, 0, 0.5] },
    ...{ step_m: 0.05, columns: 2, rows: 1, max_m: 0.8 },
  };
  const field = decode(encode(slice, Int16Array.of(-32768, 800)), world);
  assert.ok(field.kind === "slice");
  assert.deepEqual([...field.distance_mm], [-32768, 800]);
});

test("events and timings may leave out what there is not", () => {
  const event = {
    ...{ kind: "event", time_s: 3, event: "stopped", reason: "map", cause: "too old", solve_ms: 0, guess: "" },
    ...{ tried: [], attempts: 0, cost: null, takeover_s: 3, map_stamp_s: 2, stamp_to_trajectory_ms: null },
  };
  const read = decode(encode(event), world);
  assert.ok(read.kind === "event");
  assert.equal(read.cost, null);
  const timing = { kind: "timing", time_s: 3, frames: [[1, 2, 3, 4, 5]], steps: [[1, 2]], checks: 9, frames_dropped: 1 };
  const times = decode(encode(timing), world);
  assert.ok(times.kind === "timing");
  assert.deepEqual(times.frames, [
    { time_s: 1, received_s: 2, published_s: 3, integrate_ms: 4, field_ms: 5 },
  ]);
  refuses(encode({ ...timing, steps: [[1]] }), /steps\[0\] has 1 numbers, not 2/);
});

test("what is no message is refused", () => {
  refuses(new ArrayBuffer(3), /shorter/);
  refuses(Uint8Array.of(255, 255, 255, 255).buffer, /header's length/);
  refuses(Uint8Array.of(1, 0, 0, 0, 0x7b, 0, 0, 0).buffer, /no JSON/);
  refuses(encode({ kind: "gossip", time_s: 0 }), /no message is of kind "gossip"/);
  refuses(encode({ kind: "end", time_s: 0, success: true, verdict: "" }), /before any world/, null);
  refuses(encode(smallWorld({ tool_link: 2 })), /tool_link is 2/);
  refuses(encode(smallWorld({ goal: [] })), /0 poses for 2 links/);
  refuses(encode(smallWorld({ shapes: [{ link: 0, shape: { type: "cone" }, pose: [0, 0, 0, 0, 0, 0, 1] }] })), /cone/);
  const floor = { name: "floor", shape: { type: "half_space" }, pose: [0, 0, 0, 0, 0, 0, 1], moves: false };
  assert.equal((decode(encode(smallWorld({ objects: [floor] })), null) as World).objects[0].shape.type, "half_space");
  const loose = { type: "mesh", vertices: [[0, 0, 0]], triangles: [[0, 0, 1]] };
  refuses(
    encode(smallWorld({ objects: [{ name: "x", shape: loose, pose: [0, 0, 0, 0, 0, 0, 1], moves: false }] })),
    /not a whole number of 0 to 0/,
  );
});

test("no prefix of a message is taken for one, nor does it do worse than be refused", () => {
  const whole = encode(mapHeader(), new Uint8Array(2048));
  for (let length = 0; length < whole.byteLength; ++length) refuses(whole.slice(0, length), /./);
});
