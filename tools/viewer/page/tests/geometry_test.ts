import assert from "node:assert/strict";
import { test } from "node:test";
import { EdgesGeometry, Matrix4, Vector3 } from "three";
import type { Shape } from "../src/messages";
import { poseMatrix, shapeGeometry } from "../src/scene/geometry";

/** Half the extents along x, y and z. */
const kShapes: [Shape, [number, number, number]][] = [
  [{ type: "sphere", radius_m: 0.3 }, [0.3, 0.3, 0.3]],
  [{ type: "box", size_m: [0.2, 0.4, 0.6] }, [0.1, 0.2, 0.3]],
  [{ type: "cylinder", radius_m: 0.2, length_m: 1 }, [0.2, 0.2, 0.5]],
  [{ type: "capsule", radius_m: 0.2, length_m: 1 }, [0.2, 0.2, 0.7]],
];

for (const [shape, half] of kShapes) {
  test(`a ${shape.type} is centred, and lies along z`, () => {
    const geometry = shapeGeometry(shape);
    geometry.computeBoundingBox();
    const { min, max } = geometry.boundingBox as NonNullable<typeof geometry.boundingBox>;
    [max.toArray(), min.toArray().map((value) => -value)].forEach((corner) =>
      corner.forEach((value, i) => assert.ok(Math.abs(value - half[i]) < 0.01, `${corner} against ${half}`)),
    );
  });
}

test("a half-space has no faces and no edges, but can be drawn as any other shape", () => {
  const geometry = shapeGeometry({ type: "half_space" });
  assert.equal(geometry.getAttribute("position").count, 0);
  assert.equal(new EdgesGeometry(geometry).getAttribute("position").count, 0);
});

test("a mesh has the triangles it was given, each with corners of its own", () => {
  const vertices = Float32Array.of(0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1);
  const geometry = shapeGeometry({ type: "mesh", vertices, triangles: Uint32Array.of(0, 1, 2, 0, 2, 3) });
  assert.deepEqual([...geometry.getAttribute("position").array], [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1]);
});

test("a pose turns, then moves", () => {
  // A quarter turn about z.
  const pose = Float32Array.of(9, 9, 9, 9, 9, 9, 9, 1, 2, 3, 0, 0, Math.SQRT1_2, Math.SQRT1_2);
  const moved = new Vector3(1, 0, 0).applyMatrix4(poseMatrix(pose, 7, new Matrix4()));
  moved.toArray().forEach((value, i) => assert.ok(Math.abs(value - [1, 3, 3][i]) < 1e-6));
});
