// A room, or a hall, with a robot that drives round somebody: all of it by formulas.
import type { Point } from "../src/messages";

export type Pose7 = [number, number, number, number, number, number, number];

export interface Solid {
  name: string;
  moves: boolean;
  shape: { type: "box"; size_m: Point } | { type: "cylinder"; radius_m: number; length_m: number };
  /** Centre at a time; solids stand upright. */
  centre(time_s: number): Point;
}

function box(name: string, size_m: Point, centre: Point): Solid {
  return { name, moves: false, shape: { type: "box", size_m }, centre: () => centre };
}

const kWalker: Solid = {
  name: "walker",
  moves: true,
  shape: { type: "cylinder", radius_m: 0.28, length_m: 1.6 },
  centre: (t) => [1.6 + 0.25 * Math.sin(0.3 * t), -1.5 + 1.1 * (0.5 - 0.5 * Math.cos(0.5 * t)), 0.8],
};

export function roomSolids(): Solid[] {
  const shelf = [0.35, 0.8, 1.25].map((z, i) => box(`shelf board ${i + 1}`, [0.4, 1.6, 0.04], [3.75, 0.2, z]));
  return [
    box("back wall", [0.12, 6.0, 1.8], [4.1, 0, 0.9]),
    box("side wall", [5.6, 0.12, 1.8], [1.3, 2.6, 0.9]),
    box("crate", [0.5, 0.5, 0.6], [0.9, 1.7, 0.3]),
    box("table", [0.8, 1.2, 0.06], [2.9, -1.9, 0.72]),
    ...[-1, 1].flatMap((sx) => [-1, 1].map((sy) => box("table leg", [0.06, 0.06, 0.69], [2.9 + 0.35 * sx, -1.9 + 0.55 * sy, 0.345]))),
    ...shelf,
    ...[-0.75, 0.75].map((dy) => box("shelf side", [0.4, 0.04, 1.5], [3.75, 0.2 + dy, 0.75])),
    kWalker,
  ];
}

/** Rows of shelves and pillars under a ceiling: more than 100,000 voxels of 2.5 cm. */
export function hallSolids(): Solid[] {
  const solids = [kWalker, box("far wall", [0.1, 7.8, 3.0], [5.9, 0, 1.5]), box("long wall", [7.8, 0.1, 3.0], [2.0, 3.8, 1.5])];
  for (let row = 0; row < 3; ++row) {
    for (let column = 0; column < 4; ++column) {
      const at: Point = [2.6 + 1.1 * row, -2.7 + 1.5 * column, 0];
      for (let board = 0; board < 5; ++board) solids.push(box("board", [0.5, 1.1, 0.04], [at[0], at[1], 0.3 + 0.45 * board]));
      for (const dy of [-0.53, 0.53]) solids.push(box("upright", [0.5, 0.05, 2.2], [at[0], at[1] + dy, 1.1]));
    }
  }
  return solids;
}

/** Exact signed distance to a solid whose centre is known. */
function distanceFrom(solid: Solid, centre: Point, x: number, y: number, z: number): number {
  const { shape } = solid;
  const [dx, dy, dz] = [Math.abs(x - centre[0]), Math.abs(y - centre[1]), Math.abs(z - centre[2])];
  if (shape.type === "cylinder") {
    const [a, c] = [Math.sqrt(dx * dx + dy * dy) - shape.radius_m, dz - shape.length_m / 2];
    const [ap, cp] = [Math.max(a, 0), Math.max(c, 0)];
    return Math.sqrt(ap * ap + cp * cp) + Math.min(Math.max(a, c), 0);
  }
  const [a, b, c] = [dx - shape.size_m[0] / 2, dy - shape.size_m[1] / 2, dz - shape.size_m[2] / 2];
  const [ap, bp, cp] = [Math.max(a, 0), Math.max(b, 0), Math.max(c, 0)];
  return Math.sqrt(ap * ap + bp * bp + cp * cp) + Math.min(Math.max(a, b, c), 0);
}

export function distanceTo(solid: Solid, p: Point, time_s: number): number {
  return distanceFrom(solid, solid.centre(time_s), ...p);
}

/** Of all solids as they stand at one time. */
export function distanceAt(solids: readonly Solid[], time_s: number): (x: number, y: number, z: number) => number {
  const centres = solids.map((solid) => solid.centre(time_s));
  return (x, y, z) => {
    let least = Infinity;
    for (let i = 0; i < solids.length; ++i) least = Math.min(least, distanceFrom(solids[i], centres[i], x, y, z));
    return least;
  };
}

/** Turned about z, then about y. */
function pose(p: Point, yaw: number, pitch = 0): Pose7 {
  const [cz, sz, cy, sy] = [Math.cos(yaw / 2), Math.sin(yaw / 2), Math.cos(pitch / 2), Math.sin(pitch / 2)];
  return [...p, -sz * sy, cz * sy, sz * cy, cz * cy];
}

export const kLinks = ["base_link", "torso", "head", "upper_arm", "forearm", "hand"];
export const kDuration_s = 24;

/** Joints x, y, turn, lift, shoulder, elbow; `detour_m` is how far it goes round the middle. */
export function configuration(time_s: number, detour_m = 1.0): number[] {
  const share = Math.min(1, Math.max(0, time_s / kDuration_s));
  const s = share * share * (3 - 2 * share);
  const x = -0.6 + 3.6 * s;
  const y = -0.2 + 0.4 * s + detour_m * Math.sin(Math.PI * s);
  const turn = Math.atan2(0.4 + detour_m * Math.PI * Math.cos(Math.PI * s), 3.6);
  return [x, y, turn, 0.05 + 0.3 * s, -0.9 + 0.5 * s, 1.5 - 1.1 * s];
}

/** Poses of kLinks. */
export function linkPoses([x, y, turn, lift, shoulder, elbow]: number[]): Pose7[] {
  const ahead = (from: Point, r: number, pitch: number): Point => [
    from[0] + r * Math.cos(pitch) * Math.cos(turn),
    from[1] + r * Math.cos(pitch) * Math.sin(turn),
    from[2] - r * Math.sin(pitch),
  ];
  const shoulderAt: Point = ahead([x, y, 0.62 + lift], 0.14, 0);
  const elbowAt = ahead(shoulderAt, 0.34, shoulder);
  const wristAt = ahead(elbowAt, 0.3, shoulder + elbow);
  return [
    pose([x, y, 0], turn),
    pose([x, y, lift], turn),
    pose([x, y, 0.98], turn, 0.25),
    pose(shoulderAt, turn, shoulder),
    pose(elbowAt, turn, shoulder + elbow),
    pose(wristAt, turn, shoulder + elbow),
  ];
}

const kStraight: Pose7 = [0, 0, 0, 0, 0, 0, 1];
const kHalf = Math.SQRT1_2;
/** z of the shape along x of the link. */
function alongX(length_m: number): Pose7 {
  return [length_m / 2, 0, 0, 0, kHalf, 0, kHalf];
}

export const kShapes = [
  { link: 0, shape: { type: "cylinder", radius_m: 0.22, length_m: 0.24 }, pose: [0, 0, 0.14, 0, 0, 0, 1] },
  { link: 1, shape: { type: "box", size_m: [0.2, 0.24, 0.62] }, pose: [-0.02, 0, 0.5, 0, 0, 0, 1] },
  { link: 2, shape: { type: "box", size_m: [0.16, 0.26, 0.14] }, pose: kStraight },
  { link: 3, shape: { type: "capsule", radius_m: 0.055, length_m: 0.34 }, pose: alongX(0.34) },
  { link: 4, shape: { type: "capsule", radius_m: 0.045, length_m: 0.3 }, pose: alongX(0.3) },
  { link: 5, shape: { type: "box", size_m: [0.08, 0.1, 0.06] }, pose: [0.05, 0, 0, 0, 0, 0, 1] },
  ...[-1, 1].map((side) => ({
    link: 5,
    shape: {
      type: "mesh",
      vertices: [[0, -0.01, -0.02], [0.11, -0.005, -0.01], [0.11, 0.005, 0.01], [0, 0.01, 0.02], [0, 0.02, -0.02]],
      triangles: [[0, 1, 4], [1, 2, 4], [2, 3, 4], [0, 3, 2], [0, 2, 1], [0, 4, 3]],
    },
    pose: [0.08, 0.035 * side, 0, 0, 0, 0, 1],
  })),
];

export const kSpheres = [
  ...[0, 1, 2, 3].map((i) => ({
    ...{ link: 0, radius_m: 0.19 },
    centre_m: [0.09 * Math.cos((Math.PI * i) / 2), 0.09 * Math.sin((Math.PI * i) / 2), 0.16],
  })),
  ...[0.28, 0.48, 0.68].map((z) => ({ link: 1, centre_m: [-0.02, 0, z], radius_m: 0.18 })),
  { link: 2, centre_m: [0, 0, 0], radius_m: 0.17 },
  ...[0.04, 0.14, 0.24, 0.34].map((x) => ({ link: 3, centre_m: [x, 0, 0], radius_m: 0.08 })),
  ...[0.08, 0.18, 0.28].map((x) => ({ link: 4, centre_m: [x, 0, 0], radius_m: 0.07 })),
  ...[0.04, 0.13].map((x) => ({ link: 5, centre_m: [x, 0, 0], radius_m: 0.075 })),
];

export const kJoints = [
  { name: "odom_x", unit: "m", lower: -10, upper: 10, max_velocity: 0.5 },
  { name: "odom_y", unit: "m", lower: -10, upper: 10, max_velocity: 0.5 },
  { name: "odom_t", unit: "rad", lower: -10, upper: 10, max_velocity: 1 },
  { name: "lift_joint", unit: "m", lower: 0, upper: 0.69, max_velocity: 0.15 },
  { name: "shoulder_joint", unit: "rad", lower: -2.6, upper: 0, max_velocity: 1 },
  { name: "elbow_joint", unit: "rad", lower: -1.9, upper: 2.0, max_velocity: 1 },
];
