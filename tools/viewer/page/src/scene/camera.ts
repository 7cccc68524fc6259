// What the robot's camera sees: its frustum, and the points that it has measured.
import { BufferAttribute, BufferGeometry, Group, LineBasicMaterial, LineSegments, Points, PointsMaterial } from "three";
import type { Moment } from "../history";
import type { Camera, DepthFrame, World } from "../messages";
import { place } from "./geometry";
import type { Layer, Palette } from "./layer";

const kFrustumDepth_m = 0.6;

export class CameraLayer implements Layer {
  readonly object = new Group();
  private readonly frustum = new LineSegments(new BufferGeometry(), new LineBasicMaterial());
  private readonly points = new Points(
    new BufferGeometry(),
    new PointsMaterial({ size: 1.4, sizeAttenuation: false, transparent: true, opacity: 0.4 }),
  );
  private drawn: DepthFrame | null = null;

  constructor() {
    this.frustum.frustumCulled = false;
    this.points.frustumCulled = false;
    this.object.add(this.frustum, this.points);
  }

  begin(_world: World): void {
    this.drawn = null;
    this.frustum.visible = this.points.visible = false;
  }

  show(moment: Moment): void {
    const frame = moment.frame;
    this.frustum.visible = this.points.visible = frame !== null;
    if (frame === null || frame === this.drawn) return;
    this.drawn = frame;
    place(this.object, frame.pose);
    setPositions(this.frustum.geometry, frustumLines(frame.camera));
    setPositions(this.points.geometry, measuredPoints(frame));
  }

  recolour(palette: Palette): void {
    this.frustum.material.color.copy(palette["camera"]);
    this.points.material.color.copy(palette["camera"]);
  }
}

function setPositions(geometry: BufferGeometry, positions: Float32Array): void {
  const attribute = geometry.getAttribute("position") as BufferAttribute | undefined;
  if (attribute !== undefined && attribute.array.length === positions.length) {
    attribute.copyArray(positions);
    attribute.needsUpdate = true;
    return;
  }
  geometry.dispose();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
}

/** In the optical frame, as everything here. */
function frustumLines(camera: Camera): Float32Array {
  const corner = (u_px: number, v_px: number) => [
    ((u_px - camera.cx_px) / camera.fx_px) * kFrustumDepth_m,
    ((v_px - camera.cy_px) / camera.fy_px) * kFrustumDepth_m,
    kFrustumDepth_m,
  ];
  const [w, h] = [camera.width_px, camera.height_px];
  const corners = [corner(0, 0), corner(w, 0), corner(w, h), corner(0, h)];
  const lines = corners.flatMap((one, i) => [0, 0, 0, ...one, ...one, ...corners[(i + 1) % 4]]);
  return Float32Array.from(lines);
}

/** Samples are every n-th pixel, from the first on. */
function measuredPoints(frame: DepthFrame): Float32Array {
  const { camera, columns, rows, depth_mm } = frame;
  const points = new Float32Array(3 * columns * rows);
  const [step_u, step_v] = [camera.width_px / columns, camera.height_px / rows];
  for (let row = 0; row < rows; ++row) {
    for (let column = 0; column < columns; ++column) {
      const i = column + columns * row;
      const z_m = depth_mm[i] / 1000;
      points[3 * i] = ((column * step_u - camera.cx_px) / camera.fx_px) * z_m;
      points[3 * i + 1] = ((row * step_v - camera.cy_px) / camera.fy_px) * z_m;
      points[3 * i + 2] = z_m;
    }
  }
  return points;
}
