// A knob on the slice, with which it is dragged along its axis.
import { Mesh, MeshBasicMaterial, Raycaster, SphereGeometry, Vector2, Vector3 } from "three";
import type { Axis, Point } from "../messages";
import type { Palette } from "./layer";
import type { SliceLayer } from "./slice";
import type { Views } from "./views";

const kKnobShare = 0.011;
/** How far it stands from the middle of the view, as a share of the distance to the eye. */
const kAsideShare = 0.22;
/** How far from the knob a finger may come down, in its radii. */
const kReach = 2.2;

export class SliceHandle {
  readonly object = new Mesh(
    new SphereGeometry(1, 20, 14),
    new MeshBasicMaterial({ depthTest: false, transparent: true }),
  );
  /** Called while it is dragged, with the wished position. */
  dragged: (position_m: number) => void = () => {};
  private axis: Axis = "z";
  private position_m = 0;
  private readonly low = new Vector3();
  private readonly high = new Vector3();
  private grabbed: { pointer: number; screen: Vector2; position_m: number; perPixel_m: Vector2 } | null = null;

  constructor(
    private readonly slice: SliceLayer,
    private readonly views: Views,
    private readonly canvas: HTMLCanvasElement,
    private readonly changed: () => void,
  ) {
    this.object.renderOrder = 11;
    this.object.visible = false;
    // Before the camera's controls, which listen on the same canvas.
    canvas.addEventListener("pointerdown", (event) => this.grab(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event), { capture: true });
    for (const name of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(name, (event) => this.release(event), { capture: true });
    }
  }

  /** Where the slice is wished to be, between two corners of the grid. */
  place(axis: Axis, position_m: number, low_m: Point, high_m: Point): void {
    this.axis = axis;
    this.position_m = position_m;
    this.low.set(...low_m);
    this.high.set(...high_m);
    this.changed();
  }

  recolour(palette: Palette): void {
    this.object.material.color.copy(palette["followed"]);
  }

  /** Before every frame that is drawn: beside what the eye looks at, within the grid. */
  face(): void {
    this.object.visible = this.slice.object.visible && this.slice.plane.visible;
    const { camera, controls } = this.views;
    const right = new Vector3().setFromMatrixColumn(camera.matrixWorld, 0);
    const aside_m = kAsideShare * camera.position.distanceTo(controls.target);
    this.object.position.copy(controls.target).addScaledVector(right, aside_m).clamp(this.low, this.high);
    this.object.position[this.axis] = this.position_m;
    const distance_m = camera.position.distanceTo(this.object.position);
    this.object.scale.setScalar(kKnobShare * distance_m);
    this.object.updateMatrixWorld();
    const seen = this.object.position.clone().project(camera);
    const { clientWidth, clientHeight } = this.canvas;
    const at_px = [((seen.x + 1) / 2) * clientWidth, ((1 - seen.y) / 2) * clientHeight];
    this.canvas.dataset["handle"] = at_px.map((value) => value.toFixed(1)).join(" ");
  }

  private grab(event: PointerEvent): void {
    if (!this.object.visible || event.button !== 0 || !this.isHit(event)) return;
    event.stopImmediatePropagation();
    event.preventDefault();
    this.canvas.setPointerCapture(event.pointerId);
    this.grabbed = {
      pointer: event.pointerId,
      screen: new Vector2(event.clientX, event.clientY),
      position_m: this.object.position[this.axis],
      perPixel_m: this.metresPerPixel(),
    };
  }

  private move(event: PointerEvent): void {
    const grabbed = this.grabbed;
    if (grabbed === null || event.pointerId !== grabbed.pointer) return;
    event.stopImmediatePropagation();
    const moved = new Vector2(event.clientX, event.clientY).sub(grabbed.screen);
    this.dragged(grabbed.position_m + moved.dot(grabbed.perPixel_m));
  }

  private release(event: PointerEvent): void {
    if (this.grabbed?.pointer !== event.pointerId) return;
    event.stopImmediatePropagation();
    this.canvas.releasePointerCapture(event.pointerId);
    this.grabbed = null;
  }

  private isHit(event: PointerEvent): boolean {
    const box = this.canvas.getBoundingClientRect();
    const x = (2 * (event.clientX - box.left)) / box.width - 1;
    const y = 1 - (2 * (event.clientY - box.top)) / box.height;
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2(x, y), this.views.camera);
    return ray.ray.distanceToPoint(this.object.position) < kReach * this.object.scale.x;
  }

  /** How the position changes by a pixel right, and by one down: along the axis as it is seen. */
  private metresPerPixel(): Vector2 {
    const along = new Vector3();
    along[this.axis] = 0.01;
    const a = this.object.position.clone().project(this.views.camera);
    const b = this.object.position.clone().add(along).project(this.views.camera);
    const box = this.canvas.getBoundingClientRect();
    const seen = new Vector2(((b.x - a.x) * box.width) / 2, (-(b.y - a.y) * box.height) / 2);
    // An axis that points at the eye moves as if it were seen from a little aside.
    const length2 = Math.max(seen.lengthSq(), 0.05);
    return seen.multiplyScalar(0.01 / length2);
  }
}
