import assert from "node:assert/strict";
import { test } from "node:test";
import { QuadArena } from "../src/quad_arena";
import { randomNumbers } from "./random";

/** Rectangles, in any order, without the empty slots. */
function drawn(numbers: Uint16Array): string[] {
  const quads: string[] = [];
  for (let i = 0; i < numbers.length; i += 4) {
    if (numbers[i + 3] !== 0) quads.push([...numbers.subarray(i, i + 4)].join());
  }
  return quads.sort();
}

test("what is drawn is what blocks have last been given, and changed ranges carry all of it", () => {
  const random = randomNumbers(3);
  const arena = new QuadArena(2);
  const wanted = new Map<number, Uint16Array>();
  let uploaded = new Uint16Array(0);
  for (let round = 0; round < 300; ++round) {
    const block = Math.floor(random() * 12);
    const count = random() < 0.3 ? 0 : Math.floor(random() * 150);
    const quads = Uint16Array.from({ length: 4 * count }, () => 1 + Math.floor(random() * 60000));
    wanted.set(block, quads);
    arena.set(block, quads);
    if (uploaded.length !== arena.data.length) {
      const larger = new Uint16Array(arena.data.length);
      larger.set(uploaded);
      uploaded = larger;
    }
    for (const { start, count: length } of arena.takeChanges()) {
      uploaded.set(arena.data.subarray(start, start + length), start);
    }
    const expected = drawn(Uint16Array.from([...wanted.values()].flatMap((one) => [...one])));
    assert.deepEqual(drawn(uploaded.subarray(0, 4 * arena.slots)), expected);
    assert.equal(arena.count, expected.length);
  }
});

test("a change of one block rewrites its pages only", () => {
  const arena = new QuadArena();
  for (let block = 0; block < 100; ++block) arena.set(block, new Uint16Array(4 * 40).fill(block + 1));
  arena.takeChanges();
  arena.set(50, new Uint16Array(4 * 40).fill(7));
  const numbers = arena.takeChanges().reduce((sum, range) => sum + range.count, 0);
  assert.equal(numbers, 2 * 4 * 32);
});

test("space that blocks give back is used again", () => {
  const arena = new QuadArena();
  for (let round = 0; round < 50; ++round) {
    arena.set(round, new Uint16Array(4 * 100).fill(1));
    arena.set(round, new Uint16Array(0));
  }
  assert.equal(arena.slots, 4 * 32);
});
