import { Point, Shape } from "./messages";
import { asIndex, asNumbers, ProtocolError, Reader } from "./reader";

/** Throws ProtocolError for what is no shape, and for triangles without their vertices. */
export function readShape(shape: Reader): Shape {
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
