// What a run in the synthetic world tells, message by message, at ten steps a second.
import { blockCounts, Grid, kBlockBytes, Point } from "../src/messages";
import { encode } from "./encode";
import {
  configuration,
  distanceAt,
  distanceTo,
  hallSolids,
  kDuration_s,
  kJoints,
  kLinks,
  kShapes,
  kSpheres,
  linkPoses,
  Pose7,
  roomSolids,
  Solid,
} from "./synthetic_world";

export const kStep_s = 0.1;
const kMost_m = 0.8;
const kRange_m = 3.5;
const kHalfView = 0.6;

export interface RunOptions {
  place: "room" | "hall";
  /** Without: the robot has no shapes. */
  robot: boolean;
  /** Without: nothing is ever seen. */
  voxels: boolean;
  recorded: boolean;
}

export interface SliceRequest {
  axis: "x" | "y" | "z";
  position_m: number;
  ahead_s?: number;
}

const kRoom: Grid = { origin_m: [-2.0, -3.2, -0.1], voxel_m: 0.05, size_vox: [128, 128, 40] };
const kHall: Grid = { origin_m: [-2.0, -4.0, -0.1], voxel_m: 0.025, size_vox: [320, 320, 128] };

export class SyntheticRun {
  readonly grid: Grid;
  private readonly solids: Solid[];
  private readonly fixed: Solid[];
  private readonly counts: Point;
  private readonly bits = new Map<number, Uint8Array>();
  private readonly fixedBlocks = new Map<number, Uint8Array>();
  private fixedBits: Uint8Array | null = null;

  constructor(private readonly options: RunOptions) {
    this.grid = options.place === "hall" ? kHall : kRoom;
    this.solids = options.place === "hall" ? hallSolids() : roomSolids();
    this.fixed = this.solids.filter((solid) => !solid.moves);
    this.counts = blockCounts(this.grid);
  }

  world(time_s: number): ArrayBuffer {
    const upright = ([x, y, z]: Point): Pose7 => [x, y, z, 0, 0, 0, 1];
    return encode({
      ...{ kind: "world", time_s, title: `Synthetic ${this.options.place}`, episode: 3, robot: "synthetic" },
      ...{ joints: kJoints, links: kLinks, tool_link: 5, recorded: this.options.recorded },
      shapes: this.options.robot ? kShapes : [],
      spheres: kSpheres,
      objects: this.solids.map(({ name, shape, centre, moves }) => ({ name, shape, pose: upright(centre(0)), moves })),
      start: linkPoses(configuration(0)),
      goal: linkPoses(configuration(kDuration_s)),
    });
  }

  state(time_s: number): ArrayBuffer {
    const q = configuration(time_s);
    const moving = this.solids.filter((solid) => solid.moves);
    const poses = [...linkPoses(q), ...moving.map((solid) => [...solid.centre(time_s), 0, 0, 0, 1])];
    const status = time_s >= kDuration_s ? "reached" : "moving";
    const header = { kind: "state", time_s, status, q, true_q: q, clearance: this.clearance(time_s) };
    return encode(header, Float32Array.from(poses.flat()));
  }

  /** Who moves, and where they will be for 4 s, as they truly are. */
  tracks(time_s: number): ArrayBuffer {
    const moving = this.solids.filter((solid) => solid.moves);
    const at = (solid: Solid, ahead_s: number) => solid.centre(time_s + ahead_s).slice(0, 2);
    const body = { radius_m: 0.3, bottom_m: 0, top_m: 1.6 };
    const tracks = moving.map((solid, id) => {
      const [[x0, y0], [x1, y1]] = [at(solid, -0.5), at(solid, 0.5)];
      return { id, position_m: at(solid, 0), velocity_mps: [x1 - x0, y1 - y0], ...body };
    });
    const sets = moving.map((solid, track) => {
      const knots = Array.from({ length: 9 }, (_, i) => [time_s + i / 2, ...at(solid, i / 2), 0.3 + 0.05 * i]);
      return { track, likelihood: 1, bottom_m: 0, top_m: 1.6, knots };
    });
    return encode({ kind: "tracks", time_s, tracks, sets });
  }

  /** The whole of what is seen, or what has changed since the last call. */
  map(time_s: number, full: boolean): ArrayBuffer {
    const changed = this.options.voxels ? this.look(time_s) : new Set<number>();
    const blocks = full ? [...this.bits.keys()] : [...changed];
    const data = new Uint8Array(kBlockBytes * blocks.length);
    blocks.forEach((block, i) => data.set(this.bits.get(block) as Uint8Array, kBlockBytes * i));
    return encode({ kind: "map", time_s, stamp_s: time_s - 0.02, full, ...this.grid, blocks }, data);
  }

  frame(time_s: number): ArrayBuffer {
    const [columns, rows] = [64, 48];
    const camera = { width_px: 640, height_px: 480, fx_px: 480, fy_px: 480, cx_px: 320, cy_px: 240 };
    const { eye, yaw } = this.eye(time_s);
    const depth = new Uint16Array(columns * rows);
    const distance = distanceAt(this.solids, time_s);
    for (let i = 0; i < depth.length; ++i) {
      const [u, v] = [10 * (i % columns), 10 * Math.floor(i / columns)];
      depth[i] = cast(distance, eye, yaw, (u - camera.cx_px) / camera.fx_px, (v - camera.cy_px) / camera.fy_px);
    }
    const pose = [...eye, ...opticalRotation(yaw)];
    return encode({ kind: "frame", time_s, stamp_s: time_s - 0.02, pose, camera, columns, rows }, depth);
  }

  plan(time_s: number, role: "followed" | "refused", detour_m: number): ArrayBuffer {
    const times_s = Array.from({ length: 40 }, (_, i) => ((kDuration_s - time_s) * i) / 39);
    const swept_s = times_s.filter((_, i) => i % 2 === 0);
    const at = (ahead_s: number) => linkPoses(configuration(time_s + ahead_s, detour_m));
    const tool = times_s.flatMap((ahead) => at(ahead)[5].slice(0, 3));
    const base = times_s.flatMap((ahead) => at(ahead)[0].slice(0, 3));
    const swept = swept_s.flatMap((ahead) => at(ahead).flat());
    const numbers = Float32Array.from([...tool, ...base, ...swept]);
    return encode({ kind: "plan", time_s, role, start_s: time_s, times_s, swept_s }, numbers);
  }

  event(time_s: number, event: string, reason: string, cause: string, solve_ms: number): ArrayBuffer {
    return encode({
      ...{ kind: "event", time_s, event, reason, cause, solve_ms, guess: solve_ms > 0 ? "warm" : "", tried: ["warm"] },
      ...{ attempts: 1, cost: 3.2, takeover_s: time_s + 0.1, map_stamp_s: time_s - 0.03 },
      stamp_to_trajectory_ms: solve_ms > 0 ? solve_ms + 8 : null,
    });
  }

  timing(time_s: number): ArrayBuffer {
    const wave = (rate: number) => 0.5 + 0.5 * Math.sin(rate * time_s) * Math.cos(0.7 * rate * time_s);
    const frames = [0, 1, 2].map((i) => {
      const stamp_s = time_s - kStep_s + (i * kStep_s) / 3;
      return [stamp_s, stamp_s + 0.004, stamp_s + 0.012, 2.1 + 1.4 * wave(9 + i), 3.0 + 1.2 * wave(5 + 2 * i)];
    });
    const steps = [[time_s - kStep_s, 0.04 + 0.03 * wave(13) + (Math.round(time_s * 10) % 37 === 0 ? 0.6 : 0)]];
    return encode({ kind: "timing", time_s, frames, steps, checks: Math.round(250 * time_s), frames_dropped: 0 });
  }

  slice(time_s: number, { axis, position_m, ahead_s = 0 }: SliceRequest): ArrayBuffer {
    const normal = "xyz".indexOf(axis);
    const [u, v] = [0, 1, 2].filter((one) => one !== normal);
    const step_m = this.grid.voxel_m;
    const [columns, rows] = [this.grid.size_vox[u], this.grid.size_vox[v]];
    const first_m = this.grid.origin_m.map((value) => value + step_m / 2) as Point;
    first_m[normal] = position_m;
    const samples = new Int16Array(columns * rows);
    const distance = distanceAt(this.solids, time_s + ahead_s);
    for (let row = 0; row < rows; ++row) {
      for (let column = 0; column < columns; ++column) {
        const p: Point = [...first_m];
        p[u] += step_m * column;
        p[v] += step_m * row;
        const is_seen = this.options.voxels && this.isKnown(p);
        const metres = Math.min(kMost_m, distance(...p));
        samples[column + columns * row] = is_seen ? Math.round(1000 * metres) : -32768;
      }
    }
    const header = { kind: "slice", time_s, stamp_s: time_s, axis, position_m, ahead_s, first_m, step_m, columns, rows };
    return encode({ ...header, max_m: kMost_m }, samples);
  }

  end(time_s: number): ArrayBuffer {
    return encode({ kind: "end", time_s, success: true, verdict: "The goal is reached; nothing was touched." });
  }

  private clearance(time_s: number): object | null {
    const poses = linkPoses(configuration(time_s));
    let best: { distance_m: number; link: string; object: string; point_m: Point } | null = null;
    poses.forEach((pose, link) => {
      const p = pose.slice(0, 3) as Point;
      for (const solid of this.solids) {
        const distance_m = distanceTo(solid, p, time_s) - 0.1;
        if (best === null || distance_m < best.distance_m) {
          best = { distance_m, link: kLinks[link], object: solid.name, point_m: p };
        }
      }
    });
    return best;
  }

  private eye(time_s: number): { eye: Point; yaw: number } {
    const [x, y, turn] = configuration(time_s);
    return { eye: [x + 0.08 * Math.cos(turn), y + 0.08 * Math.sin(turn), 1.0], yaw: turn + 0.5 * Math.sin(0.8 * time_s) };
  }

  /** Bits of what stands still, computed once. */
  private fixedOccupancy(): Uint8Array {
    if (this.fixedBits !== null) return this.fixedBits;
    const [nx, ny, nz] = this.grid.size_vox;
    this.fixedBits = new Uint8Array(nx * ny * nz);
    for (const solid of this.fixed) this.rasterise(solid, 0, (index) => ((this.fixedBits as Uint8Array)[index] = 1));
    return this.fixedBits;
  }

  private rasterise(solid: Solid, time_s: number, mark: (index: number) => void): void {
    const { origin_m, voxel_m, size_vox } = this.grid;
    const half = solid.shape.type === "box" ? solid.shape.size_m.map((one) => one / 2) : [0.4, 0.4, 1];
    const centre = solid.centre(time_s);
    const range = centre.map((value, i) => {
      const from = Math.floor((value - half[i] - origin_m[i]) / voxel_m) - 1;
      const to = Math.ceil((value + half[i] - origin_m[i]) / voxel_m) + 1;
      return [Math.max(0, from), Math.min(size_vox[i] - 1, to)];
    });
    for (let z = range[2][0]; z <= range[2][1]; ++z)
      for (let y = range[1][0]; y <= range[1][1]; ++y)
        for (let x = range[0][0]; x <= range[0][1]; ++x) {
          const p = [x, y, z].map((value, i) => origin_m[i] + voxel_m * (value + 0.5)) as Point;
          if (distanceTo(solid, p, time_s) <= voxel_m / 2) mark(x + size_vox[0] * (y + size_vox[1] * z));
        }
  }

  /** Takes in what lies within view; returns the blocks that this changes. */
  private look(time_s: number): Set<number> {
    const moving = new Map<number, number[]>();
    for (const solid of this.solids.filter((one) => one.moves)) {
      this.rasterise(solid, time_s, (index) => {
        const { block, bit } = this.blockOf(index);
        moving.set(block, [...(moving.get(block) ?? []), bit]);
      });
    }
    const { eye, yaw } = this.eye(time_s);
    const changed = new Set<number>();
    const [nx, ny, nz] = this.counts;
    for (let block = 0; block < nx * ny * nz; ++block) {
      const at: Point = [block % nx, Math.floor(block / nx) % ny, Math.floor(block / (nx * ny))];
      if (this.isInView(at, eye, yaw) && this.refresh(block, at, moving.get(block) ?? [])) changed.add(block);
    }
    return changed;
  }

  private blockOf(index: number): { block: number; bit: number } {
    const [sx, sy] = this.grid.size_vox;
    const [x, y, z] = [index % sx, Math.floor(index / sx) % sy, Math.floor(index / (sx * sy))];
    const block = (x >> 4) + this.counts[0] * ((y >> 4) + this.counts[1] * (z >> 4));
    return { block, bit: (x & 15) + 16 * ((y & 15) + 16 * (z & 15)) };
  }

  private isInView(block: Point, eye: Point, yaw: number): boolean {
    const middle = block.map((value, i) => this.grid.origin_m[i] + this.grid.voxel_m * 16 * (value + 0.5)) as Point;
    const [dx, dy] = [middle[0] - eye[0], middle[1] - eye[1]];
    const off = Math.abs(Math.atan2(Math.sin(Math.atan2(dy, dx) - yaw), Math.cos(Math.atan2(dy, dx) - yaw)));
    const distance = Math.hypot(dx, dy);
    return distance < 0.9 || (distance < kRange_m && off < kHalfView) || this.options.place === "hall";
  }

  private refresh(block: number, at: Point, moving: number[]): boolean {
    const bytes = Uint8Array.from(this.fixedBlock(block, at));
    for (const bit of moving) bytes[bit >> 3] |= 1 << (bit & 7);
    const before = this.bits.get(block);
    if (before !== undefined && Buffer.compare(before, bytes) === 0) return false;
    this.bits.set(block, bytes);
    return true;
  }

  /** A block as it is once it has been seen, without what moves. */
  private fixedBlock(block: number, at: Point): Uint8Array {
    const known = this.fixedBlocks.get(block);
    if (known !== undefined) return known;
    const fixed = this.fixedOccupancy();
    const bytes = new Uint8Array(kBlockBytes);
    const [sx, sy, sz] = this.grid.size_vox;
    for (let i = 0; i < 4096; ++i) {
      const [x, y, z] = [16 * at[0] + (i % 16), 16 * at[1] + ((i >> 4) % 16), 16 * at[2] + (i >> 8)];
      if (x >= sx || y >= sy || z >= sz) continue;
      if (fixed[x + sx * (y + sy * z)] === 1) bytes[i >> 3] |= 1 << (i & 7);
      bytes[512 + (i >> 3)] |= 1 << (i & 7);
    }
    this.fixedBlocks.set(block, bytes);
    return bytes;
  }

  private isKnown(p: Point): boolean {
    const voxel = p.map((value, i) => Math.floor((value - this.grid.origin_m[i]) / this.grid.voxel_m / 16));
    return this.bits.has(voxel[0] + this.counts[0] * (voxel[1] + this.counts[1] * voxel[2]));
  }
}

/** Millimetres along the optical axis, by stepping as far as nothing can be; 0 beyond the range. */
function cast(
  distance: (x: number, y: number, z: number) => number,
  [x, y, z]: Point,
  yaw: number,
  right: number,
  down: number,
): number {
  const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
  const [dx, dy, dz] = [c + s * right, s - c * right, -down];
  const length = Math.sqrt(dx * dx + dy * dy + dz * dz);
  let ahead_m = 0.2;
  for (let i = 0; i < 40 && ahead_m < 2 * kRange_m; ++i) {
    const free_m = Math.min(z + dz * ahead_m, distance(x + dx * ahead_m, y + dy * ahead_m, z + dz * ahead_m));
    if (free_m < 0.01) return Math.round(1000 * ahead_m);
    ahead_m += free_m / length;
  }
  return 0;
}

/** x right, y down, z ahead, level and turned by `yaw`. */
function opticalRotation(yaw: number): [number, number, number, number] {
  // Rotation about z by yaw - 90 degrees, then about x by -90 degrees.
  const [c, s] = [Math.cos((yaw - Math.PI / 2) / 2), Math.sin((yaw - Math.PI / 2) / 2)];
  const h = Math.SQRT1_2;
  return [-c * h, -s * h, s * h, c * h];
}
