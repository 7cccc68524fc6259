// Reads a binary message of docs/reference/viewer.md. What does not keep to it is a ProtocolError:
// nothing behind this has to check a length or an index again.
import {
  Axis,
  blockCounts,
  Clearance,
  DepthFrame,
  End,
  kBlockBytes,
  MapUpdate,
  Message,
  Plan,
  Point,
  Pose,
  RunEvent,
  Shape,
  Slice,
  Sphere,
  State,
  Timing,
  Tracks,
  World,
} from "./messages";
import { asIndex, asNumbers, asText, ProtocolError, Reader } from "./reader";

export { ProtocolError } from "./reader";

const kMostVoxelsAlong = 65535;
const kMostSamplesAlong = 8192;

/** The bytes behind a header, handed out front to back. */
class Payload {
  private used = 0;
  constructor(
    private readonly buffer: ArrayBuffer,
    private readonly start: number,
  ) {}

  take(bytes: number): number {
    const offset = this.start + this.used;
    this.used += bytes;
    if (offset + bytes > this.buffer.byteLength) {
      throw new ProtocolError(
        `the payload has ${this.buffer.byteLength - this.start} bytes, at least ${this.used} are due`,
      );
    }
    return offset;
  }

  bytes(count: number): Uint8Array {
    return new Uint8Array(this.buffer, this.take(count), count);
  }
  floats(count: number): Float32Array {
    return finite(new Float32Array(this.buffer, this.take(4 * count), count));
  }
  unsigned(count: number): Uint16Array {
    return new Uint16Array(this.buffer, this.take(2 * count), count);
  }
  signed(count: number): Int16Array {
    return new Int16Array(this.buffer, this.take(2 * count), count);
  }

  finish(): void {
    const left = this.buffer.byteLength - this.start - this.used;
    if (left !== 0) throw new ProtocolError(`${left} bytes are left over behind the payload`);
  }
}

function finite(values: Float32Array): Float32Array {
  if (!values.every(Number.isFinite)) throw new ProtocolError("the payload has numbers that are not finite");
  return values;
}

/** `world` is the last one told, which says how many links and objects there are. */
export function decode(buffer: ArrayBuffer, world: World | null): Message {
  const { header, text, start } = readHeader(buffer);
  const payload = new Payload(buffer, start);
  const message = readMessage(header, text, payload, world);
  payload.finish();
  return message;
}

/** Of any message, whatever its kind; the payload begins at `start`. */
export function readHeader(buffer: ArrayBuffer): { header: Reader; text: string; start: number } {
  const { text, start } = splitHeader(buffer);
  return { header: Reader.of(parse(text), "header"), text, start };
}

function splitHeader(buffer: ArrayBuffer): { text: string; start: number } {
  if (buffer.byteLength < 4) throw new ProtocolError("shorter than the length of its header");
  const length = new DataView(buffer).getUint32(0, true);
  if (length > buffer.byteLength - 4) throw new ProtocolError(`the header's length ${length} is too large`);
  const text = new TextDecoder().decode(new Uint8Array(buffer, 4, length));
  // Senders may leave the padding out where no payload follows.
  return { text, start: Math.min(4 + Math.ceil(length / 4) * 4, buffer.byteLength) };
}

function parse(text: string): unknown {
  try {
    return JSON.parse(text);
  } catch {
    throw new ProtocolError("the header is no JSON");
  }
}

function readMessage(header: Reader, text: string, payload: Payload, world: World | null): Message {
  const kind = header.text("kind");
  if (kind === "world") return readWorld(header, text);
  if (world === null) throw new ProtocolError(`${kind} came before any world`);
  switch (kind) {
    case "map":
      return readMap(header, payload);
    case "state":
      return readState(header, payload, world);
    case "tracks":
      return readTracks(header);
    case "frame":
      return readFrame(header, payload);
    case "plan":
      return readPlan(header, payload, world);
    case "event":
      return readEvent(header);
    case "timing":
      return readTiming(header);
    case "slice":
      return readSlice(header, payload);
    case "end":
      return readEnd(header);
    default:
      throw new ProtocolError(`no message is of kind "${kind}"`);
  }
}

function asPose(value: unknown, where: string): Pose {
  return asNumbers(value, where, 7);
}

function readWorld(header: Reader, text: string): World {
  const links = header.list("links", asText);
  const goal = header.list("goal", asPose);
  if (goal.length !== links.length) throw new ProtocolError(`goal has ${goal.length} poses for ${links.length} links`);
  return {
    kind: "world",
    time_s: header.number("time_s"),
    identity: identityOf(text),
    recorded: header.flag("recorded"),
    title: header.text("title"),
    episode: header.number("episode"),
    robot: header.text("robot"),
    joints: header.list("joints", (value, where) => {
      const joint = Reader.of(value, where);
      return {
        name: joint.text("name"),
        unit: joint.text("unit"),
        lower: joint.numberOrNull("lower"),
        upper: joint.numberOrNull("upper"),
      };
    }),
    links,
    toolLink: header.index("tool_link", links.length),
    shapes: header.list("shapes", (value, where) => {
      const part = Reader.of(value, where);
      const link = part.index("link", links.length);
      return { link, shape: readShape(part.child("shape")), pose: part.numbers("pose", 7) };
    }),
    spheres: readSpheres(header, links.length),
    objects: header.list("objects", (value, where) => {
      const object = Reader.of(value, where);
      return {
        name: object.text("name"),
        shape: readShape(object.child("shape")),
        pose: object.numbers("pose", 7),
        moves: object.flag("moves"),
      };
    }),
    goal,
  };
}

/** The list `spheres`, on links of which there are so many. */
export function readSpheres(header: Reader, links: number): Sphere[] {
  return header.list("spheres", (value, where) => {
    const sphere = Reader.of(value, where);
    return {
      link: sphere.index("link", links),
      centre_m: sphere.numbers("centre_m", 3) as Point,
      radius_m: sphere.positive("radius_m"),
    };
  });
}

function identityOf(text: string): string {
  const { time_s: _, ...rest } = JSON.parse(text) as Record<string, unknown>;
  return JSON.stringify(rest);
}

function readMap(header: Reader, payload: Payload): MapUpdate {
  const grid = {
    origin_m: header.numbers("origin_m", 3) as Point,
    voxel_m: header.positive("voxel_m"),
    size_vox: header.numbers("size_vox", 3) as Point,
  };
  for (const size of grid.size_vox) {
    if (!Number.isInteger(size) || size < 1 || size > kMostVoxelsAlong) {
      throw new ProtocolError(`size_vox has ${size}, not a whole number of 1 to ${kMostVoxelsAlong}`);
    }
  }
  const [nx, ny, nz] = blockCounts(grid);
  const blocks = header.numbers("blocks");
  for (const block of blocks) {
    if (!Number.isInteger(block) || block < 0 || block >= nx * ny * nz) {
      throw new ProtocolError(`there is no block ${block} among ${nx * ny * nz}`);
    }
  }
  return {
    kind: "map",
    time_s: header.number("time_s"),
    stamp_s: header.number("stamp_s"),
    full: header.flag("full"),
    grid,
    blocks,
    data: payload.bytes(kBlockBytes * blocks.length),
  };
}

function readClearance(header: Reader): Clearance | null {
  if (header.isNull("clearance")) return null;
  const clearance = header.child("clearance");
  return {
    distance_m: clearance.number("distance_m"),
    link: clearance.text("link"),
    object: clearance.text("object"),
    point_m: clearance.numbers("point_m", 3) as Point,
  };
}

function readState(header: Reader, payload: Payload, world: World): State {
  const bodies = world.links.length + world.objects.filter((object) => object.moves).length;
  return {
    kind: "state",
    time_s: header.number("time_s"),
    status: header.text("status"),
    q: header.isNull("q") ? [] : header.numbers("q"),
    trueQ: header.isNull("true_q") ? null : header.numbers("true_q"),
    clearance: readClearance(header),
    poses: payload.floats(7 * bodies),
  };
}

function readTracks(header: Reader): Tracks {
  return {
    kind: "tracks",
    time_s: header.number("time_s"),
    tracks: header.list("tracks", (value, where) => {
      const track = Reader.of(value, where);
      return {
        id: track.number("id"),
        position_m: track.numbers("position_m", 2),
        velocity_mps: track.numbers("velocity_mps", 2),
        radius_m: track.number("radius_m"),
        bottom_m: track.number("bottom_m"),
        top_m: track.number("top_m"),
      };
    }),
    sets: header.list("sets", (value, where) => {
      const set = Reader.of(value, where);
      return {
        track: set.number("track"),
        likelihood: set.positive("likelihood"),
        bottom_m: set.number("bottom_m"),
        top_m: set.number("top_m"),
        knots: set.list("knots", (knot, at) => {
          const [time_s, x_m, y_m, radius_m] = asNumbers(knot, at, 4);
          return { time_s, centre_m: [x_m, y_m] as [number, number], radius_m };
        }),
      };
    }),
  };
}

function readFrame(header: Reader, payload: Payload): DepthFrame {
  const camera = header.child("camera");
  const columns = header.index("columns", kMostSamplesAlong);
  const rows = header.index("rows", kMostSamplesAlong);
  return {
    kind: "frame",
    time_s: header.number("time_s"),
    stamp_s: header.number("stamp_s"),
    pose: header.numbers("pose", 7),
    camera: {
      width_px: camera.positive("width_px"),
      height_px: camera.positive("height_px"),
      fx_px: camera.positive("fx_px"),
      fy_px: camera.positive("fy_px"),
      cx_px: camera.number("cx_px"),
      cy_px: camera.number("cy_px"),
    },
    columns,
    rows,
    depth_mm: payload.unsigned(columns * rows),
  };
}

function readPlan(header: Reader, payload: Payload, world: World): Plan {
  const times_s = header.numbers("times_s");
  const swept_s = header.numbers("swept_s");
  return {
    kind: "plan",
    time_s: header.number("time_s"),
    role: header.oneOf("role", ["followed", "refused"]),
    start_s: header.number("start_s"),
    times_s,
    toolPath: payload.floats(3 * times_s.length),
    basePath: payload.floats(3 * times_s.length),
    swept_s,
    sweptPoses: payload.floats(7 * world.links.length * swept_s.length),
  };
}

function readEvent(header: Reader): RunEvent {
  return {
    kind: "event",
    time_s: header.number("time_s"),
    event: header.text("event"),
    reason: header.textOrEmpty("reason"),
    cause: header.textOrEmpty("cause"),
    solve_ms: header.numberOrNull("solve_ms"),
    guess: header.textOrEmpty("guess"),
    attempts: header.numberOrNull("attempts"),
    cost: header.numberOrNull("cost"),
    takeover_s: header.numberOrNull("takeover_s"),
    stampToTrajectory_ms: header.numberOrNull("stamp_to_trajectory_ms"),
  };
}

function readTiming(header: Reader): Timing {
  return {
    kind: "timing",
    time_s: header.number("time_s"),
    frames: header.list("frames", (value, where) => {
      const [time_s, received_s, published_s, integrate_ms, field_ms] = asNumbers(value, where, 5);
      return { time_s, received_s, published_s, integrate_ms, field_ms };
    }),
    steps: header.list("steps", (value, where) => {
      const [time_s, step_ms] = asNumbers(value, where, 2);
      return { time_s, step_ms };
    }),
    checks: header.number("checks"),
    framesDropped: header.number("frames_dropped"),
  };
}

function readSlice(header: Reader, payload: Payload): Slice {
  const columns = header.index("columns", kMostSamplesAlong);
  const rows = header.index("rows", kMostSamplesAlong);
  return {
    kind: "slice",
    time_s: header.number("time_s"),
    stamp_s: header.number("stamp_s"),
    axis: header.oneOf<Axis>("axis", ["x", "y", "z"]),
    position_m: header.number("position_m"),
    ahead_s: header.numberOrNull("ahead_s"),
    first_m: header.numbers("first_m", 3) as Point,
    step_m: header.positive("step_m"),
    columns,
    rows,
    max_m: header.positive("max_m"),
    distance_mm: payload.signed(columns * rows),
  };
}

function readEnd(header: Reader): End {
  return {
    kind: "end",
    time_s: header.number("time_s"),
    success: header.flag("success"),
    verdict: header.text("verdict"),
  };
}

/** Throws ProtocolError for what is no shape, and for triangles without their vertices. */
function readShape(shape: Reader): Shape {
  const type = shape.text("type");
  switch (type) {
    case "sphere":
      return { type, radius_m: shape.positive("radius_m") };
    case "box":
      return { type, size_m: shape.numbers("size_m", 3) as Point };
    case "cylinder":
    case "capsule":
      return { type, radius_m: shape.positive("radius_m"), length_m: shape.number("length_m") };
    case "half_space":
      return { type };
    case "mesh":
      return readMesh(shape);
    default:
      throw new ProtocolError(`no shape is of type "${type}"`);
  }
}

function readMesh(shape: Reader): Shape {
  const vertices = shape.list("vertices", (value, where) => asNumbers(value, where, 3));
  const triangles = shape.list("triangles", (value, where) =>
    asNumbers(value, where, 3).map((corner) => asIndex(corner, vertices.length, where)),
  );
  return {
    type: "mesh",
    vertices: new Float32Array(vertices.flat()),
    triangles: new Uint32Array(triangles.flat()),
  };
}
