import assert from "node:assert/strict";
import { test } from "node:test";
import type { Point } from "../src/messages";
import { BlockBits, blockBits, borderDiffers, meshBlock, Neighbours, QuadList, Surface, unpackQuad } from "../src/meshing";
import { randomNumbers } from "./random";

type Cell = "occupied" | "free" | "unknown";

/** A grid of cells and, of it, all single faces by looking at every voxel and its neighbours. */
class Oracle {
  readonly cells: Cell[];
  constructor(
    readonly size: Point,
    cell: (x: number, y: number, z: number) => Cell,
  ) {
    this.cells = [];
    for (let z = 0; z < size[2]; ++z)
      for (let y = 0; y < size[1]; ++y) for (let x = 0; x < size[0]; ++x) this.cells.push(cell(x, y, z));
  }

  at([x, y, z]: Point): Cell | "outside" {
    const [nx, ny, nz] = this.size;
    if (x < 0 || y < 0 || z < 0 || x >= nx || y >= ny || z >= nz) return "outside";
    return this.cells[x + nx * (y + ny * z)];
  }

  faces(surface: Surface): string[] {
    const faces: string[] = [];
    for (let z = 0; z < this.size[2]; ++z)
      for (let y = 0; y < this.size[1]; ++y)
        for (let x = 0; x < this.size[0]; ++x)
          for (let face = 0; face < 6; ++face) {
            const next: Point = [x, y, z];
            next[face >> 1] += face % 2 === 0 ? 1 : -1;
            const [here, there] = [this.at([x, y, z]), this.at(next)];
            const exposed =
              surface === "occupied"
                ? here === "occupied" && there !== "occupied"
                : here === "free" && there === "unknown";
            if (exposed) faces.push([x, y, z, face].join());
          }
    return faces.sort();
  }

  /** Bit by bit, as the protocol lays blocks out; null where nothing is known. */
  block(bx: number, by: number, bz: number): BlockBits | "outside" | null {
    if (this.at([16 * bx, 16 * by, 16 * bz]) === "outside") return "outside";
    const bytes = new Uint8Array(1024);
    let any = false;
    for (let i = 0; i < 4096; ++i) {
      const cell = this.at([16 * bx + (i % 16), 16 * by + ((i >> 4) % 16), 16 * bz + (i >> 8)]);
      if (cell === "occupied") bytes[i >> 3] |= 1 << (i & 7);
      if (cell === "occupied" || cell === "free") bytes[512 + (i >> 3)] |= 1 << (i & 7);
      any ||= cell === "occupied" || cell === "free";
    }
    return any ? blockBits(bytes) : null;
  }
}

function meshAll(oracle: Oracle, surface: Surface): QuadList {
  const out = new QuadList();
  const [nx, ny, nz] = oracle.size.map((size) => Math.ceil(size / 16));
  for (let z = 0; z < nz; ++z)
    for (let y = 0; y < ny; ++y)
      for (let x = 0; x < nx; ++x) {
        const bits = oracle.block(x, y, z);
        if (bits === null || bits === "outside") continue;
        const neighbours: Neighbours = [
          [x - 1, y, z], [x + 1, y, z], [x, y - 1, z], [x, y + 1, z], [x, y, z - 1], [x, y, z + 1],
        ].map(([a, b, c]) => oracle.block(a, b, c));
        const corner: Point = [16 * x, 16 * y, 16 * z];
        const extent = oracle.size.map((size, i) => Math.min(16, size - corner[i])) as Point;
        meshBlock(bits, neighbours, surface, corner, extent, out);
      }
  return out;
}

/** The single faces that rectangles cover, each as often as it is covered. */
function facesOf(list: QuadList): string[] {
  const faces: string[] = [];
  for (let i = 0; i < list.quads.length; i += 4) {
    const { face, width, height } = unpackQuad(list.quads[i + 3]);
    const axis = face >> 1;
    const [alongU, alongV] = [axis === 0 ? 1 : 0, axis === 2 ? 1 : 2];
    for (let v = 0; v < height; ++v)
      for (let u = 0; u < width; ++u) {
        const voxel = [...list.quads.subarray(i, i + 3)];
        voxel[alongU] += u;
        voxel[alongV] += v;
        faces.push([...voxel, face].join());
      }
  }
  return faces.sort();
}

const kSize: Point = [37, 34, 21];

for (const [name, occupied, known] of [
  ["sparse", 0.02, 0.7],
  ["half full", 0.5, 0.9],
  ["nearly full", 0.95, 0.9],
] as const) {
  for (const surface of ["occupied", "frontier"] as const) {
    test(`rectangles cover each exposed face once: ${name}, ${surface}`, () => {
      const random = randomNumbers(7);
      const oracle = new Oracle(kSize, () =>
        random() >= known ? "unknown" : random() < occupied ? "occupied" : "free",
      );
      const faces = facesOf(meshAll(oracle, surface));
      assert.ok(faces.length > 100);
      assert.deepEqual(faces, oracle.faces(surface));
    });
  }
}

test("nothing is drawn where unseen space meets the end of the grid, nor where all is seen", () => {
  const seen = new Oracle(kSize, () => "free");
  assert.equal(meshAll(seen, "frontier").count, 0);
  assert.equal(meshAll(seen, "occupied").count, 0);
});

test("blocks of which nothing is known are unseen space", () => {
  const oracle = new Oracle([48, 16, 16], (x) => (x < 16 ? "free" : "unknown"));
  assert.deepEqual(facesOf(meshAll(oracle, "frontier")), oracle.faces("frontier"));
  assert.equal(meshAll(oracle, "frontier").count, 1);
});

test("a wall is one rectangle a block and side", () => {
  const oracle = new Oracle([32, 32, 32], (x) => (x === 5 ? "occupied" : "free"));
  // Four blocks: two large sides each, and of the rim two narrow ones each.
  assert.equal(meshAll(oracle, "occupied").count, 4 * 2 + 4 * 2);
});

test("a difference at a border is seen by the neighbour across it, and by no other", () => {
  const block = (x: number, y: number, z: number) => {
    const bytes = new Uint8Array(1024);
    const bit = x + 16 * (y + 16 * z);
    bytes[bit >> 3] |= 1 << (bit & 7);
    return blockBits(bytes);
  };
  const sidesOf = (bits: BlockBits) => [0, 1, 2, 3, 4, 5].filter((side) => borderDiffers(null, bits, side));
  assert.deepEqual(sidesOf(block(7, 8, 9)), []);
  assert.deepEqual(sidesOf(block(0, 8, 9)), [0]);
  assert.deepEqual(sidesOf(block(15, 8, 9)), [1]);
  assert.deepEqual(sidesOf(block(7, 0, 9)), [2]);
  assert.deepEqual(sidesOf(block(7, 15, 9)), [3]);
  assert.deepEqual(sidesOf(block(7, 8, 0)), [4]);
  assert.deepEqual(sidesOf(block(7, 8, 15)), [5]);
  assert.deepEqual(sidesOf(block(15, 0, 15)), [1, 2, 5]);
  assert.equal(borderDiffers(block(0, 0, 0), block(0, 0, 0), 0), false);
});
