import assert from "node:assert/strict";
import { test } from "node:test";
import type { History } from "../src/history";
import { Session } from "../src/session";
import { encode, mapHeader, smallWorld } from "./encode";

function tell(session: Session, ...messages: ArrayBuffer[]): void {
  for (const message of messages) session.take(message);
}

function state(time_s: number): ArrayBuffer {
  const header = { kind: "state", time_s, status: "moving", q: [], true_q: null, clearance: null };
  return encode(header, new Float32Array(21));
}

function map(time_s: number): ArrayBuffer {
  return encode(mapHeader({ time_s, blocks: [0] }), new Uint8Array(1024).fill(3));
}

function watched(): { session: Session; begun: History[] } {
  const begun: History[] = [];
  return { session: new Session((history) => begun.push(history)), begun };
}

for (const [name, world_s] of [
  ["of the moment", 9.5],
  ["as it was at the beginning", 0],
] as const) {
  test(`an episode goes on after a lost connection, with a world ${name}`, () => {
    const { session, begun } = watched();
    tell(session, encode(smallWorld({ time_s: 0 })), map(0), state(1), state(9));
    tell(session, encode(smallWorld({ time_s: world_s })), map(9.5), state(9.6));
    assert.equal(begun.length, 1);
    assert.equal(session.history?.states.items.length, 3);
  });
}

test("the same run begun anew is another one, though its world is the same", () => {
  const { session, begun } = watched();
  tell(session, encode(smallWorld({ time_s: 0 })), map(0), state(1), state(9));
  tell(session, encode(smallWorld({ time_s: 0 })), map(0.2), state(0.3));
  assert.equal(begun.length, 2);
  assert.deepEqual(session.history?.states.items.map((one) => one.time_s), [0.3]);
  assert.equal(session.history?.map.at(0.3)?.block(0, 0.3)?.[0], 3, "with the map that came with it");
});

test("of a live run the newest episode is kept, of a recording every one", () => {
  for (const recorded of [false, true]) {
    const { session, begun } = watched();
    for (const episode of [0, 1, 2]) tell(session, encode(smallWorld({ time_s: 0, episode, recorded })), state(0.5 + episode));
    assert.equal(session.episodes.length, recorded ? 3 : 1);
    assert.equal(begun.length, recorded ? 1 : 3, "a recording is looked at from its first episode on");
    assert.equal(session.history?.world.episode, recorded ? 0 : 2);
    session.choose(recorded ? 2 : 0);
    assert.equal(session.history?.last_s, 2.5);
  }
});

test("a recording that is told again is known", () => {
  const { session } = watched();
  const all = [encode(smallWorld({ time_s: 0, recorded: true })), map(0), state(1), map(2), state(2)];
  tell(session, ...all, ...all);
  assert.equal(session.episodes.length, 1);
  assert.equal(session.history?.states.items.length, 2);
  assert.equal(session.history?.map.bytes, 1024);
});
