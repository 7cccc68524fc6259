import assert from "node:assert/strict";
import { test } from "node:test";
import { discAt } from "../src/scene/people";

const kSet = {
  ...{ track: 1, likelihood: 1, bottom_m: 0, top_m: 1.7 },
  knots: [
    { time_s: 10, centre_m: [1, 2] as [number, number], radius_m: 0.3 },
    { time_s: 12, centre_m: [2, 0] as [number, number], radius_m: 0.7 },
    { time_s: 13, centre_m: [2, 1] as [number, number], radius_m: 0.7 },
  ],
};

test("a predicted disc goes straight from knot to knot, and is nowhere outside of them", () => {
  assert.deepEqual(discAt(kSet, 10), { x_m: 1, y_m: 2, radius_m: 0.3 });
  assert.deepEqual(discAt(kSet, 11), { x_m: 1.5, y_m: 1, radius_m: 0.5 });
  assert.deepEqual(discAt(kSet, 12.5), { x_m: 2, y_m: 0.5, radius_m: 0.7 });
  assert.equal(discAt(kSet, 9.9), null);
  assert.equal(discAt(kSet, 13.1), null);
  assert.equal(discAt({ ...kSet, knots: [] }, 10), null);
});
