// Everything that is drawn of a run.
import type { History, Moment } from "../history";
import type { Grid, World } from "../messages";
import { CameraLayer } from "./camera";
import { SceneCanvas } from "./canvas";
import { ClearanceLayer } from "./clearance";
import type { Layer } from "./layer";
import { MapView } from "./map_view";
import { FixedObjectsLayer, MovingObjectsLayer } from "./objects";
import { GoalLayer, RobotLayer, SpheresLayer } from "./robot";
import { SliceLayer } from "./slice";
import { SliceHandle } from "./slice_handle";
import { PredictedLayer, TracksLayer } from "./people";
import { SweptLayer } from "./swept";
import { TrajectoryLayer } from "./trajectories";
import type { Views } from "./views";

const kMeshing_ms = 7;

export interface StageElements {
  canvas: HTMLCanvasElement;
  clearanceLabel: HTMLElement;
}

export class Stage {
  readonly views: Views;
  readonly handle: SliceHandle;
  private readonly room: SceneCanvas;
  private readonly map = new MapView();
  private readonly predicted = new PredictedLayer();
  private readonly clearance: ClearanceLayer;
  private readonly layers: Record<string, Layer>;

  /** Throws where the browser has no WebGL. */
  constructor(elements: StageElements) {
    this.room = new SceneCanvas(elements.canvas);
    this.views = this.room.views;
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
      tracks: new TracksLayer(),
      predicted: this.predicted,
      moving: new MovingObjectsLayer(),
      fixed: new FixedObjectsLayer(),
      goal: new GoalLayer(),
      camera: new CameraLayer(),
      clearance: this.clearance,
    };
    this.room.scene.add(this.handle.object);
    for (const layer of Object.values(this.layers)) this.room.scene.add(layer.object);
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

  lookAhead(ahead_s: number): void {
    this.predicted.lookAhead(ahead_s);
    this.invalidate();
  }

  recolour(): void {
    const palette = this.room.recolour();
    for (const layer of Object.values(this.layers)) layer.recolour(palette);
    this.handle.recolour(palette);
  }

  invalidate(): void {
    this.room.invalidate();
  }

  /** Once per frame of the screen; draws what is due. */
  frame(): void {
    const { canvas } = this.room;
    if (this.map.busy) {
      this.map.work(kMeshing_ms);
      this.invalidate();
      canvas.dataset["quads"] = String(this.map.voxelQuads);
    }
    this.room.frame(() => {
      this.clearance.face(this.views.camera, canvas.clientWidth, canvas.clientHeight);
      this.handle.face();
    });
  }
}
