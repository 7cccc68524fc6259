import { BufferAttribute, BufferGeometry } from "three";

/**
 * Lines a metre apart on z = 0, from -half_m to half_m. In pieces of a metre: a line that passes the
 * eye is drawn wrongly, or not at all, by some drivers.
 */
export function groundLines(half_m: number): BufferGeometry {
  const lines: number[] = [];
  for (let across = -half_m; across <= half_m; ++across) {
    for (let along = -half_m; along < half_m; ++along) {
      lines.push(along, across, 0, along + 1, across, 0);
      lines.push(across, along, 0, across, along + 1, 0);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(Float32Array.from(lines), 3));
  return geometry;
}
