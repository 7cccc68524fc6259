// Times the meshing of a whole hall against the plain way, voxel by voxel.
//
//   node build/tests/meshing_benchmark.js
import type { MapUpdate, Point, World } from "../src/messages";
import { blockCounts } from "../src/messages";
import { BlockBits, blockBits, meshBlock, QuadList } from "../src/meshing";
import { decode } from "../src/protocol";
import { SyntheticRun } from "./synthetic_run";

const run = new SyntheticRun({ place: "hall", robot: true, voxels: true, recorded: false });
const world = decode(run.world(0), null) as World;
const map = decode(run.map(5, true), world) as MapUpdate;
const [nx, ny, nz] = blockCounts(map.grid);
const blocks = new Map<number, BlockBits>();
map.blocks.forEach((block, i) => blocks.set(block, blockBits(map.data.subarray(1024 * i, 1024 * (i + 1)))));

const kSteps: Point[] = [[-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]];

function place(block: number): Point {
  return [block % nx, Math.floor(block / nx) % ny, Math.floor(block / (nx * ny))];
}

function meshAll(out: QuadList): void {
  for (const [block, bits] of blocks) {
    const [x, y, z] = place(block);
    const neighbours = kSteps.map(([dx, dy, dz]) => {
      const [a, b, c] = [x + dx, y + dy, z + dz];
      if (a < 0 || b < 0 || c < 0 || a >= nx || b >= ny || c >= nz) return "outside";
      return blocks.get(a + nx * (b + ny * c)) ?? null;
    });
    meshBlock(bits, neighbours, "occupied", [16 * x, 16 * y, 16 * z], [16, 16, 16], out);
  }
}

function isOccupied(x: number, y: number, z: number): boolean {
  const block = blocks.get((x >> 4) + nx * ((y >> 4) + ny * (z >> 4)));
  if (block === undefined || Math.min(x, y, z) < 0) return false;
  return ((block.occupied[(y & 15) + 16 * (z & 15)] >> (x & 15)) & 1) === 1;
}

/** How many faces are exposed, by looking at each voxel. */
function plainFaces(): { voxels: number; faces: number } {
  let [voxels, faces] = [0, 0];
  const [sx, sy, sz] = map.grid.size_vox;
  for (let z = 0; z < sz; ++z)
    for (let y = 0; y < sy; ++y)
      for (let x = 0; x < sx; ++x) {
        if (!isOccupied(x, y, z)) continue;
        ++voxels;
        for (const [dx, dy, dz] of kSteps) if (!isOccupied(x + dx, y + dy, z + dz)) ++faces;
      }
  return { voxels, faces };
}

function medianTime_ms(repetitions: number, work: () => void): number {
  const times = Array.from({ length: repetitions }, () => {
    const begun = performance.now();
    work();
    return performance.now() - begun;
  });
  return times.sort((a, b) => a - b)[repetitions >> 1];
}

const list = new QuadList();
const meshing_ms = medianTime_ms(15, () => {
  list.count = 0;
  meshAll(list);
});
let counted = { voxels: 0, faces: 0 };
const plain_ms = medianTime_ms(5, () => (counted = plainFaces()));
console.log(`${blocks.size} blocks, ${counted.voxels} occupied voxels, ${counted.faces} exposed faces`);
console.log(`merged: ${list.count} rectangles in ${meshing_ms.toFixed(1)} ms, ${((1000 * meshing_ms) / blocks.size).toFixed(1)} us a block`);
console.log(`plain:  ${counted.faces} faces in ${plain_ms.toFixed(1)} ms`);
