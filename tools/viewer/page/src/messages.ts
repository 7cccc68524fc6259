// What a run tells, as docs/reference/viewer.md lays it down: lengths in metres, angles in radians,
// times on the run's clock in seconds, everything in the world frame unless said otherwise.

/** x, y, z, qx, qy, qz, qw. */
export type Pose = number[];
export type Point = [number, number, number];
export type Axis = "x" | "y" | "z";

export type Shape =
  | { type: "sphere"; radius_m: number }
  | { type: "box"; size_m: Point }
  | { type: "cylinder" | "capsule"; radius_m: number; length_m: number }
  | { type: "half_space" }
  | { type: "mesh"; vertices: Float32Array; triangles: Uint32Array };

export interface Joint {
  name: string;
  unit: string;
  lower: number | null;
  upper: number | null;
}

/** On a link, in its frame. */
export interface Sphere {
  link: number;
  centre_m: Point;
  radius_m: number;
}

export interface World {
  kind: "world";
  time_s: number;
  /** All that it says but its time: equal for the same episode. */
  identity: string;
  recorded: boolean;
  title: string;
  episode: number;
  robot: string;
  joints: Joint[];
  links: string[];
  toolLink: number;
  shapes: { link: number; shape: Shape; pose: Pose }[];
  spheres: Sphere[];
  objects: { name: string; shape: Shape; pose: Pose; moves: boolean }[];
  goal: Pose[];
}

export interface Grid {
  /** The corner of voxel 0. */
  origin_m: Point;
  voxel_m: number;
  size_vox: Point;
}

export interface MapUpdate {
  kind: "map";
  time_s: number;
  stamp_s: number;
  full: boolean;
  grid: Grid;
  blocks: number[];
  /** kBlockBytes of each. */
  data: Uint8Array;
}

export interface Clearance {
  distance_m: number;
  link: string;
  object: string;
  point_m: Point;
}

export interface State {
  kind: "state";
  time_s: number;
  status: string;
  q: number[];
  trueQ: number[] | null;
  clearance: Clearance | null;
  /** 7 numbers of every link, then of every object that moves. */
  poses: Float32Array;
}

/** A thing that is tracked, as a vertical cylinder. */
export interface Track {
  id: number;
  position_m: number[];
  velocity_mps: number[];
  radius_m: number;
  bottom_m: number;
  top_m: number;
}

/** Where one of them may be: a cylinder whose centre and radius change linearly from knot to knot. */
export interface PredictedSet {
  track: number;
  likelihood: number;
  bottom_m: number;
  top_m: number;
  knots: { time_s: number; centre_m: [number, number]; radius_m: number }[];
}

export interface Tracks {
  kind: "tracks";
  time_s: number;
  tracks: Track[];
  sets: PredictedSet[];
}

export interface Camera {
  width_px: number;
  height_px: number;
  fx_px: number;
  fy_px: number;
  cx_px: number;
  cy_px: number;
}

export interface DepthFrame {
  kind: "frame";
  time_s: number;
  stamp_s: number;
  /** Of the camera's optical frame: z ahead, x right, y down. */
  pose: Pose;
  camera: Camera;
  columns: number;
  rows: number;
  /** 0 where nothing was measured. */
  depth_mm: Uint16Array;
}

export interface Plan {
  kind: "plan";
  time_s: number;
  role: "followed" | "refused";
  start_s: number;
  /** From start_s on, as swept_s. */
  times_s: number[];
  /** 3 numbers of each of times_s, as basePath. */
  toolPath: Float32Array;
  basePath: Float32Array;
  swept_s: number[];
  /** Poses of all links at each of swept_s. */
  sweptPoses: Float32Array;
}

export interface RunEvent {
  kind: "event";
  time_s: number;
  event: string;
  reason: string;
  cause: string;
  solve_ms: number | null;
  guess: string;
  attempts: number | null;
  cost: number | null;
  takeover_s: number | null;
  stampToTrajectory_ms: number | null;
}

export interface FrameTiming {
  time_s: number;
  received_s: number;
  published_s: number;
  integrate_ms: number;
  field_ms: number;
}

export interface StepTiming {
  time_s: number;
  step_ms: number;
}

export interface Timing {
  kind: "timing";
  time_s: number;
  frames: FrameTiming[];
  steps: StepTiming[];
  checks: number;
  framesDropped: number;
}

export interface Slice {
  kind: "slice";
  time_s: number;
  stamp_s: number;
  axis: Axis;
  position_m: number;
  /** Later than the map by so much, with what is predicted; null where it is the map's alone. */
  ahead_s: number | null;
  first_m: Point;
  step_m: number;
  columns: number;
  rows: number;
  max_m: number;
  /** kNeverObserved where nobody has looked. */
  distance_mm: Int16Array;
}

export interface End {
  kind: "end";
  time_s: number;
  success: boolean;
  verdict: string;
}

export type Message = World | MapUpdate | State | Tracks | DepthFrame | Plan | RunEvent | Timing | Slice | End;

export const kBlockSide = 16;
export const kBlockBytes = 1024;
export const kNeverObserved = -32768;

/** Blocks along x, y and z; the last ones may be cut off by the grid's size. */
export function blockCounts(grid: Grid): Point {
  return grid.size_vox.map((size) => Math.ceil(size / kBlockSide)) as Point;
}
