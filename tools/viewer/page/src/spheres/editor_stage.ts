// The robot's shapes, and the spheres, of which one can be taken hold of.
import {
  Color,
  IcosahedronGeometry,
  InstancedMesh,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  Object3D,
  Raycaster,
  Vector2,
  Vector3,
} from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";
import type { History, Moment } from "../history";
import type { Point, Sphere, World } from "../messages";
import { SceneCanvas } from "../scene/canvas";
import { poseMatrix } from "../scene/geometry";
import { placeSpheres, RobotLayer } from "../scene/robot";

const kMostSpheres = 2000;
/** How far a finger may move and still mean the sphere that it came down on. */
const kTap_px = 5;

export type Tool = "move" | "resize";

export class EditorStage {
  readonly room: SceneCanvas;
  /** Told of what is done in the scene. */
  picked: (index: number | null) => void = () => {};
  moved: (centre_m: Point) => void = () => {};
  resized: (radius_m: number) => void = () => {};
  released: () => void = () => {};
  private readonly robot = new RobotLayer();
  private readonly wires = new InstancedMesh(
    new IcosahedronGeometry(1, 3),
    new MeshBasicMaterial({ wireframe: true, transparent: true, opacity: 0.3, depthWrite: false }),
    kMostSpheres,
  );
  private readonly body = new Mesh(
    new IcosahedronGeometry(1, 5),
    // Seen through the shapes, too.
    new MeshStandardMaterial({ transparent: true, opacity: 0.5, depthTest: false, roughness: 0.8 }),
  );
  private readonly grip = new Object3D();
  private readonly controls: TransformControls;
  private world: World | null = null;
  private poses = new Float32Array();
  private spheres: readonly Sphere[] = [];
  private selected: number | null = null;
  private grabbedRadius_m = 0;
  private colours = { plain: new Color(), selected: new Color() };

  constructor(canvas: HTMLCanvasElement) {
    this.room = new SceneCanvas(canvas);
    this.wires.frustumCulled = false;
    this.wires.count = 0;
    this.body.visible = false;
    this.body.renderOrder = 5;
    this.controls = new TransformControls(this.room.views.camera, canvas);
    this.controls.setSpace("local");
    this.controls.size = 0.8;
    this.controls.addEventListener("change", () => this.room.invalidate());
    this.controls.addEventListener("objectChange", () => this.drag());
    this.controls.addEventListener("dragging-changed", ({ value }) => this.grab(value as boolean));
    this.room.scene.add(this.robot.object, this.wires, this.body, this.grip, this.controls.getHelper());
    this.listen(canvas);
  }

  begin(moment: Moment, history: History): void {
    this.world = history.world;
    this.poses = (moment.state?.poses ?? new Float32Array(7 * history.world.links.length)) as Float32Array<ArrayBuffer>;
    this.robot.begin(history.world);
    this.robot.show(moment);
    this.robot.object.traverse((part) => {
      if (part instanceof Mesh) Object.assign(part.material as object, { transparent: true, opacity: 0.82 });
    });
    this.room.views.begin(history.world);
    this.room.views.show(moment);
    this.room.invalidate();
  }

  show(spheres: readonly Sphere[], selected: number | null): void {
    if (this.world === null) return;
    this.spheres = spheres;
    this.selected = selected;
    this.wires.count = Math.min(spheres.length, kMostSpheres);
    placeSpheres(this.wires, 0, { ...this.world, spheres: [...spheres] }, this.poses, 0);
    this.wires.instanceMatrix.needsUpdate = true;
    this.wires.computeBoundingSphere();
    this.paint();
    this.hold(selected === null ? null : (spheres[selected] ?? null));
    this.room.invalidate();
  }

  choose(tool: Tool): void {
    this.controls.setMode(tool === "move" ? "translate" : "scale");
    this.room.invalidate();
  }

  /** The shapes hide what lies behind them. */
  showShapes(shown: boolean): void {
    this.robot.object.visible = shown;
    this.room.invalidate();
  }

  recolour(): void {
    const palette = this.room.recolour();
    this.robot.recolour(palette);
    this.colours = { plain: palette["spheres"], selected: palette["clearance"] };
    this.body.material.color.copy(this.colours.selected);
    this.paint();
  }

  frame(): void {
    this.room.frame(() => this.tellPlace());
  }

  private paint(): void {
    for (let i = 0; i < this.wires.count; ++i) {
      this.wires.setColorAt(i, i === this.selected ? this.colours.selected : this.colours.plain);
    }
    if (this.wires.instanceColor !== null) this.wires.instanceColor.needsUpdate = true;
  }

  private linkMatrix(link: number): Matrix4 {
    return poseMatrix(this.poses, 7 * link, new Matrix4());
  }

  private hold(sphere: Sphere | null): void {
    this.body.visible = sphere !== null;
    if (sphere === null) {
      this.controls.detach();
      return;
    }
    const matrix = this.linkMatrix(sphere.link);
    const at = new Vector3(...sphere.centre_m).applyMatrix4(matrix);
    this.body.position.copy(at);
    this.body.scale.setScalar(sphere.radius_m);
    if (this.controls.dragging) return;
    this.grip.position.copy(at);
    this.grip.quaternion.setFromRotationMatrix(matrix);
    this.grip.scale.setScalar(1);
    this.controls.attach(this.grip);
  }

  private grab(isDragged: boolean): void {
    this.room.views.controls.enabled = !isDragged;
    const sphere = this.selected === null ? undefined : this.spheres[this.selected];
    this.grabbedRadius_m = sphere?.radius_m ?? 0;
    if (!isDragged) {
      this.released();
      this.hold(sphere ?? null);
    }
  }

  private drag(): void {
    const sphere = this.selected === null ? undefined : this.spheres[this.selected];
    if (sphere === undefined) return;
    if (this.controls.getMode() === "translate") {
      const p = this.grip.position.clone().applyMatrix4(this.linkMatrix(sphere.link).invert());
      this.moved([p.x, p.y, p.z]);
      return;
    }
    // Whichever axis is pulled, a sphere stays a sphere.
    const scales = this.grip.scale.toArray().map(Math.abs);
    const factor = scales.reduce((most, one) => (Math.abs(one - 1) > Math.abs(most - 1) ? one : most), 1);
    this.resized(this.grabbedRadius_m * factor);
  }

  private listen(canvas: HTMLCanvasElement): void {
    const down = new Vector2();
    canvas.addEventListener("pointerdown", (event) => down.set(event.clientX, event.clientY));
    canvas.addEventListener("pointerup", (event) => {
      const isTap = down.distanceTo(new Vector2(event.clientX, event.clientY)) < kTap_px;
      if (isTap && event.button === 0 && this.controls.axis === null) this.picked(this.sphereAt(event));
    });
  }

  /** The nearest sphere under a finger; of several, where it was selected already, the next one. */
  private sphereAt(event: PointerEvent): number | null {
    const box = this.room.canvas.getBoundingClientRect();
    const at = new Vector2((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
    const ray = new Raycaster();
    ray.setFromCamera(at, this.room.views.camera);
    const hits = [...new Set(ray.intersectObject(this.wires).map((hit) => hit.instanceId as number))];
    if (hits.length === 0) return null;
    return hits[(hits.indexOf(this.selected ?? -1) + 1) % hits.length];
  }

  /** For tests: where the selected sphere is on the screen. */
  private tellPlace(): void {
    const seen = this.body.position.clone().project(this.room.views.camera);
    const { clientWidth, clientHeight } = this.room.canvas;
    const at_px = [((seen.x + 1) / 2) * clientWidth, ((1 - seen.y) / 2) * clientHeight];
    this.room.canvas.dataset["selected"] = this.body.visible ? at_px.map((value) => value.toFixed(1)).join(" ") : "";
  }
}
