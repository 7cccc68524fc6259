// Writes messages as docs/reference/viewer.md says, independently of what reads them.

export function encode(header: object, ...payload: ArrayBufferView[]): ArrayBuffer {
  const text = Buffer.from(JSON.stringify(header), "utf-8");
  const padding = (4 - (text.length % 4)) % 4;
  const length = Buffer.alloc(4);
  length.writeUInt32LE(text.length);
  const parts = payload.map((part) => Buffer.from(part.buffer, part.byteOffset, part.byteLength));
  const whole = Buffer.concat([length, text, Buffer.alloc(padding), ...parts]);
  return whole.buffer.slice(whole.byteOffset, whole.byteOffset + whole.byteLength) as ArrayBuffer;
}

/** The world that tests of single messages speak of: two links, two objects of which one moves. */
export function smallWorld(changes: object = {}): Record<string, unknown> {
  const pose = [0, 0, 0, 0, 0, 0, 1];
  return {
    kind: "world",
    time_s: 1.5,
    title: "Small",
    episode: 0,
    robot: "two links",
    joints: [{ name: "lift", unit: "m", lower: 0, upper: 0.6, max_velocity: 0.2 }],
    links: ["base", "hand"],
    tool_link: 1,
    shapes: [
      { link: 0, shape: { type: "cylinder", radius_m: 0.2, length_m: 0.3 }, pose },
      {
        link: 1,
        shape: { type: "mesh", vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles: [[0, 1, 2]] },
        pose,
      },
    ],
    spheres: [{ link: 1, centre_m: [0, 0, 0.1], radius_m: 0.1 }],
    objects: [
      { name: "table", shape: { type: "box", size_m: [1, 1, 0.1] }, pose, moves: false },
      { name: "walker", shape: { type: "capsule", radius_m: 0.3, length_m: 1.2 }, pose, moves: true },
    ],
    start: [pose, pose],
    goal: [pose, pose],
    ...changes,
  };
}

export function mapHeader(changes: object = {}): Record<string, unknown> {
  return {
    kind: "map",
    time_s: 2,
    stamp_s: 1.9,
    full: true,
    origin_m: [-1, -1, 0],
    voxel_m: 0.05,
    size_vox: [40, 32, 16],
    blocks: [0, 5],
    ...changes,
  };
}
