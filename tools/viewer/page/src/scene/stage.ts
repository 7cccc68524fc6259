// The canvas with everything that is drawn in it. It is drawn again when something has changed, and
// only then: whoever looks on may share the robot's machine.
import {
  Color,
  DirectionalLight,
  HemisphereLight,
  LineBasicMaterial,
  LineSegments,
  Scene,
  WebGLRenderer,
} from "three";
import type { History, Moment } from "../history";
import type { Grid, World } from "../messages";
import { CameraLayer } from "./camera";
import { ClearanceLayer } from "./clearance";
import { groundLines } from "./ground";
import type { Layer } from "./layer";
import { MapView } from "./map_view";
import { FixedObjectsLayer, MovingObjectsLayer } from "./objects";
import { readPalette } from "./palette";
import { GoalLayer, RobotLayer, SpheresLayer } from "./robot";
import { SliceLayer } from "./slice";
import { SliceHandle } from "./slice_handle";
import { SweptLayer } from "./swept";
import { TrajectoryLayer } from "./trajectories";
import { Views } from "./views";

const kMeshing_ms = 7;

export interface StageElements {
  canvas: HTMLCanvasElement;
  clearanceLabel: HTMLElement;
}

export class Stage {
  readonly views: Views;
  readonly handle: SliceHandle;
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly ground = new LineSegments(groundLines(12), new LineBasicMaterial());
  private readonly map = new MapView();
  private readonly clearance: ClearanceLayer;
  private readonly layers: Record<string, Layer>;
  private dirty = true;

  /** Throws where the browser has no WebGL. */
  constructor(private readonly elements: StageElements) {
    this.renderer = new WebGLRenderer({ canvas: elements.canvas, antialias: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.views = new Views(elements.canvas, () => this.invalidate());
    this.clearance = new ClearanceLayer(elements.clearanceLabel);
    const slice = new SliceLayer();
    this.handle = new SliceHandle(slice, this.views, elements.canvas, () => this.invalidate());
    this.layers = {
      robot: new RobotLayer(),
      spheres: new SpheresLayer(),
      voxels: this.map.voxelLayer,
      unknown: this.map.unknownLayer,
      slice,
      followed: new TrajectoryLayer("followed"),
      previous: new TrajectoryLayer("previous"),
      refused: new TrajectoryLayer("refused"),
      swept: new SweptLayer(),
      moving: new MovingObjectsLayer(),
      fixed: new FixedObjectsLayer(),
      goal: new GoalLayer(),
      camera: new CameraLayer(),
      clearance: this.clearance,
    };
    this.furnish();
    new ResizeObserver(() => this.resize()).observe(elements.canvas.parentElement as HTMLElement);
    this.resize();
  }

  get grid(): Grid | null {
    return this.map.grid;
  }

  begin(world: World): void {
    for (const layer of Object.values(this.layers)) layer.begin(world);
    this.views.begin(world);
    this.invalidate();
  }

  show(moment: Moment, history: History): void {
    for (const layer of Object.values(this.layers)) layer.show(moment, history);
    this.views.show(moment);
    this.invalidate();
  }

  toggle(id: string, shown: boolean): void {
    const layer = this.layers[id];
    layer.object.visible = shown;
    layer.toggle?.(shown);
    this.invalidate();
  }

  cutAbove(z_m: number): void {
    this.map.cutAbove(z_m);
    this.invalidate();
  }

  recolour(): void {
    const palette = readPalette();
    this.scene.background = palette["scene-bottom"];
    this.ground.material.color.copy(palette["ground"]);
    for (const layer of Object.values(this.layers)) layer.recolour(palette);
    this.handle.recolour(palette);
    this.invalidate();
  }

  invalidate(): void {
    this.dirty = true;
  }

  /** Once per frame of the screen; draws what is due. */
  frame(): void {
    if (this.map.busy) {
      this.map.work(kMeshing_ms);
      this.dirty = true;
      this.elements.canvas.dataset["quads"] = String(this.map.voxelQuads);
    }
    if (!this.dirty) return;
    this.dirty = false;
    const canvas = this.elements.canvas;
    this.clearance.face(this.views.camera, canvas.clientWidth, canvas.clientHeight);
    this.handle.face();
    this.renderer.render(this.scene, this.views.camera);
    canvas.dataset["frames"] = String(Number(canvas.dataset["frames"] ?? 0) + 1);
  }

  private furnish(): void {
    const sky = new HemisphereLight(new Color("#ffffff"), new Color("#8a8f98"), 1.7);
    sky.position.set(0, 0, 1);
    const sun = new DirectionalLight(new Color("#ffffff"), 1.6);
    sun.position.set(-2, -3, 5);
    this.scene.add(this.ground, sky, sun, this.handle.object);
    for (const layer of Object.values(this.layers)) this.scene.add(layer.object);
  }

  private resize(): void {
    const room = this.elements.canvas.parentElement as HTMLElement;
    const [width_px, height_px] = [Math.max(1, room.clientWidth), Math.max(1, room.clientHeight)];
    this.renderer.setSize(width_px, height_px, false);
    this.views.resize(width_px, height_px);
    this.invalidate();
  }
}
