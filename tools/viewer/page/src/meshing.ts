// The faces of voxels that can be seen, block by block, as few rectangles: greedy merging, 16 voxels
// of a row at a time as the bits of one number.
import { kBlockSide, Point } from "./messages";

const kRows = kBlockSide * kBlockSide;
const kAll = 0xffff;

/** One block as rows along x: bit x of element y + 16 z. */
export interface BlockBits {
  occupied: Uint16Array;
  known: Uint16Array;
}

/** -x, +x, -y, +y, -z, +z: the neighbours' bits, "outside" of the grid, or null where nothing was seen. */
export type Neighbours = readonly (BlockBits | "outside" | null)[];


/** The two halves of a block's bytes (docs/reference/viewer.md), which are not copied. */
export function blockBits(bytes: Uint8Array): BlockBits {
  return {
    occupied: new Uint16Array(bytes.buffer, bytes.byteOffset, kRows),
    known: new Uint16Array(bytes.buffer, bytes.byteOffset + 2 * kRows, kRows),
  };
}

/**
 * What is drawn of a block: faces of the voxels in `inside` that meet none in `hiding`.
 * "occupied": occupied voxels, wherever their neighbour is not occupied.
 * "frontier": known free voxels, where they meet what nobody has seen.
 */
export type Surface = "occupied" | "frontier";

const kEmpty: BlockBits = { occupied: new Uint16Array(kRows), known: new Uint16Array(kRows) };

function insideRow(bits: BlockBits, surface: Surface, row: number): number {
  return surface === "occupied" ? bits.occupied[row] : bits.known[row] & ~bits.occupied[row];
}

function hidingRow(bits: BlockBits, surface: Surface, row: number): number {
  return surface === "occupied" ? bits.occupied[row] : bits.occupied[row] | bits.known[row];
}

/** Rectangles of 4 numbers: x, y, z of the lowest voxel in the grid, and packQuad(). */
export class QuadList {
  data = new Uint16Array(4 * 256);
  count = 0;

  push(x: number, y: number, z: number, packed: number): void {
    if (4 * this.count === this.data.length) {
      const larger = new Uint16Array(2 * this.data.length);
      larger.set(this.data);
      this.data = larger;
    }
    this.data.set([x, y, z, packed], 4 * this.count++);
  }

  get quads(): Uint16Array {
    return this.data.subarray(0, 4 * this.count);
  }
}

/** 13 bits; width and height of 1 to 16 voxels. No rectangle packs to 0. */
export function packQuad(face: number, width: number, height: number): number {
  return face | (width << 3) | (height << 8);
}

export function unpackQuad(packed: number): { face: number; width: number; height: number } {
  return { face: packed & 7, width: (packed >> 3) & 31, height: packed >> 8 };
}

/** Scratch of one thread, 18 rows by 18 of what hides, with the neighbours' borders. */
const hiding = new Int32Array(18 * 18);
const inside = new Int32Array(kRows);
const mask = new Int32Array(kBlockSide);
const masksOfX = new Int32Array(kBlockSide * kBlockSide);

/**
 * Appends the rectangles of one block. `corner` is its first voxel, `extent` how many of its 16
 * voxels along each axis lie in the grid.
 */
export function meshBlock(
  bits: BlockBits,
  neighbours: Neighbours,
  surface: Surface,
  corner: Point,
  extent: Point,
  out: QuadList,
): void {
  if (!gather(bits, neighbours, surface, extent)) return;
  meshAcrossX(corner, out);
  meshAcross(1, corner, out);
  meshAcross(2, corner, out);
}

/** Index of row (y, z) of the block in `hiding`, whose bits are shifted by one for x = -1. */
function at(y: number, z: number): number {
  return y + 1 + 18 * (z + 1);
}

function gather(bits: BlockBits, neighbours: Neighbours, surface: Surface, extent: Point): boolean {
  const within = kAll >> (kBlockSide - extent[0]);
  // What lies outside of the grid hides what is unknown, and nothing else.
  const outside = surface === "frontier" ? kAll : 0;
  let any = 0;
  const sides = neighbours.map((side) => (side === "outside" ? null : (side ?? kEmpty)));
  const borderRow = (side: number, row: number) => {
    const of = sides[side];
    return of === null ? outside : hidingRow(of, surface, row);
  };
  for (let z = 0; z < kBlockSide; ++z) {
    for (let y = 0; y < kBlockSide; ++y) {
      const row = y + kBlockSide * z;
      const inGrid = y < extent[1] && z < extent[2];
      inside[row] = inGrid ? insideRow(bits, surface, row) & within : 0;
      any |= inside[row];
      const own = inGrid ? (hidingRow(bits, surface, row) & within) | (outside & ~within) : outside;
      const below = (borderRow(0, row) >> (kBlockSide - 1)) & 1;
      const above = borderRow(1, row) & 1;
      hiding[at(y, z)] = below | (own << 1) | (above << (kBlockSide + 1));
    }
  }
  if (any === 0) return false;
  for (let i = 0; i < kBlockSide; ++i) {
    hiding[at(-1, i)] = borderRow(2, kBlockSide - 1 + kBlockSide * i) << 1;
    hiding[at(kBlockSide, i)] = borderRow(3, kBlockSide * i) << 1;
    hiding[at(i, -1)] = borderRow(4, i + kBlockSide * (kBlockSide - 1)) << 1;
    hiding[at(i, kBlockSide)] = borderRow(5, i) << 1;
  }
  return true;
}

/** Faces across y (`axis` 1) or z (2): u runs along x, v along the other one. */
function meshAcross(axis: 1 | 2, corner: Point, out: QuadList): void {
  for (const step of [1, -1]) {
    for (let w = 0; w < kBlockSide; ++w) {
      let any = 0;
      for (let v = 0; v < kBlockSide; ++v) {
        const [y, z] = axis === 1 ? [w, v] : [v, w];
        const next = axis === 1 ? at(y + step, z) : at(y, z + step);
        mask[v] = inside[y + kBlockSide * z] & ~(hiding[next] >> 1);
        any |= mask[v];
      }
      if (any === 0) continue;
      merge(mask, 0, (u, v, width, height) => {
        const packed = packQuad(2 * axis + (step > 0 ? 0 : 1), width, height);
        const [y, z] = axis === 1 ? [w, v] : [v, w];
        out.push(corner[0] + u, corner[1] + y, corner[2] + z, packed);
      });
    }
  }
}

/** Faces across x: u runs along y, v along z. */
function meshAcrossX(corner: Point, out: QuadList): void {
  for (const face of [0, 1]) {
    masksOfX.fill(0);
    for (let z = 0; z < kBlockSide; ++z) {
      for (let y = 0; y < kBlockSide; ++y) {
        const hides = hiding[at(y, z)] >> (face === 0 ? 2 : 0);
        let exposed = inside[y + kBlockSide * z] & ~hides;
        while (exposed !== 0) {
          const x = lowestBit(exposed);
          masksOfX[kBlockSide * x + z] |= 1 << y;
          exposed &= exposed - 1;
        }
      }
    }
    for (let x = 0; x < kBlockSide; ++x) {
      merge(masksOfX, kBlockSide * x, (u, v, width, height) =>
        out.push(corner[0] + x, corner[1] + u, corner[2] + v, packQuad(face, width, height)),
      );
    }
  }
}

function lowestBit(bits: number): number {
  return 31 - Math.clz32(bits & -bits);
}

/** Covers the bits of 16 rows, which it clears, with rectangles. */
function merge(
  rows: Int32Array,
  first: number,
  emit: (u: number, v: number, width: number, height: number) => void,
): void {
  for (let v = 0; v < kBlockSide; ++v) {
    while (rows[first + v] !== 0) {
      const row = rows[first + v];
      const u = lowestBit(row);
      const width = lowestBit(~(row >> u));
      const run = ((1 << width) - 1) << u;
      let height = 1;
      rows[first + v] &= ~run;
      while (v + height < kBlockSide && (rows[first + v + height] & run) === run) {
        rows[first + v + height++] &= ~run;
      }
      emit(u, v, width, height);
    }
  }
}

/** Whether a neighbour across side `side` (-x, +x, -y, +y, -z, +z) would see a difference of two blocks. */
export function borderDiffers(a: BlockBits | null, b: BlockBits | null, side: number): boolean {
  const [one, two] = [a ?? kEmpty, b ?? kEmpty];
  const last = kBlockSide - 1;
  const bit = side === 0 ? 1 : side === 1 ? 1 << last : kAll;
  for (let j = 0; j < kBlockSide; ++j) {
    const rowsAcrossX = side < 2 ? kBlockSide : 1;
    for (let i = 0; i < rowsAcrossX; ++i) {
      const row = side < 2 ? i + kBlockSide * j : borderRowIndex(side, j, last);
      const differs = (one.occupied[row] ^ two.occupied[row]) | (one.known[row] ^ two.known[row]);
      if ((differs & bit) !== 0) return true;
    }
  }
  return false;
}

function borderRowIndex(side: number, j: number, last: number): number {
  switch (side) {
    case 2:
      return kBlockSide * j;
    case 3:
      return last + kBlockSide * j;
    case 4:
      return j;
    default:
      return j + kBlockSide * last;
  }
}
