import assert from "node:assert/strict";
import { test } from "node:test";
import { History } from "../src/history";
import type { World } from "../src/messages";
import { Playback } from "../src/playback";
import { decode } from "../src/protocol";
import { encode, smallWorld } from "./encode";

function told(recorded: boolean, until_s: number): History {
  const world = decode(encode(smallWorld({ time_s: 0, recorded })), null) as World;
  const history = new History(world);
  for (let time_s = 0; time_s <= until_s; time_s += 0.25) tellState(history, time_s);
  return history;
}

function tellState(history: History, time_s: number): void {
  const header = { kind: "state", time_s, status: "moving", q: [], true_q: null, clearance: null };
  history.add(decode(encode(header, new Float32Array(21)), history.world));
}

function attached(history: History): Playback {
  const playback = new Playback();
  playback.attach(history);
  playback.tick(0);
  return playback;
}

test("a live run is shown live, and stays where it is when paused", () => {
  const history = told(false, 10);
  const playback = attached(history);
  assert.deepEqual([playback.mode, playback.time_s], ["live", 10]);
  playback.toggle();
  tellState(history, 12);
  playback.tick(0.5);
  assert.deepEqual([playback.mode, playback.time_s], ["paused", 10]);
  playback.goLive();
  playback.tick(0);
  assert.equal(playback.time_s, 12);
});

test("steps go from one state to the next, and end where the states do", () => {
  const playback = attached(told(false, 2));
  const seen: number[] = [];
  for (let i = 0; i < 3; ++i) {
    playback.step(-1);
    seen.push(playback.time_s);
  }
  playback.step(1);
  assert.deepEqual([...seen, playback.time_s], [1.75, 1.5, 1.25, 1.5]);
  playback.seek(-5);
  assert.equal(playback.time_s, 0);
  playback.step(-1);
  assert.deepEqual([playback.mode, playback.time_s], ["paused", 0]);
});

test("what is played from the past goes on at its speed until it has caught up", () => {
  const playback = attached(told(false, 10));
  playback.seek(4);
  assert.equal(playback.mode, "paused");
  playback.toggle();
  playback.speed = 2;
  playback.tick(1);
  assert.deepEqual([playback.mode, playback.time_s], ["playing", 6]);
  playback.tick(2);
  assert.deepEqual([playback.mode, playback.time_s], ["live", 10]);
});

test("what is no longer kept is not shown", () => {
  const history = told(false, 10);
  const playback = attached(history);
  playback.seek(1);
  for (let time_s = 10; time_s <= 100; ++time_s) tellState(history, time_s);
  playback.tick(0);
  assert.equal(playback.time_s, history.first_s);
});

test("a recording plays from its beginning, stops at its end, and begins again", () => {
  const history = told(true, 10);
  const playback = attached(history);
  assert.deepEqual([playback.mode, playback.time_s], ["playing", 0]);
  playback.tick(20);
  assert.deepEqual([playback.mode, playback.time_s], ["playing", 10], "more of it may be on its way");
  history.add(decode(encode({ kind: "end", time_s: 10, success: true, verdict: "" }), history.world));
  playback.tick(0);
  assert.equal(playback.mode, "paused");
  playback.toggle();
  assert.deepEqual([playback.mode, playback.time_s], ["playing", 0]);
});
