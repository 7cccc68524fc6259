// The place where robot and obstacle are closest, with a label that names both.
import { Group, Mesh, MeshBasicMaterial, PerspectiveCamera, RingGeometry, SphereGeometry, Vector3 } from "three";
import { inCm, setText } from "../dom";
import type { Moment } from "../history";
import type { Clearance, World } from "../messages";
import type { Layer, Palette } from "./layer";

/** Share of the distance to the eye: the mark is as large on the screen wherever it is. */
const kMarkShare = 0.008;

export class ClearanceLayer implements Layer {
  readonly object = new Group();
  private readonly material = new MeshBasicMaterial({ depthTest: false, transparent: true });
  private readonly dot = new Mesh(new SphereGeometry(0.45, 16, 12), this.material);
  private readonly ring = new Mesh(new RingGeometry(1.15, 1.5, 40), this.material);
  private clearance: Clearance | null = null;

  constructor(private readonly label: HTMLElement) {
    this.dot.renderOrder = this.ring.renderOrder = 10;
    this.object.add(this.dot, this.ring);
  }

  begin(_world: World): void {
    this.clearance = null;
  }

  show(moment: Moment): void {
    this.clearance = moment.state?.clearance ?? null;
  }

  recolour(palette: Palette): void {
    this.material.color.copy(palette["clearance"]);
  }

  /** Before every frame that is drawn: turns the mark to the eye and puts the label beside it. */
  face(camera: PerspectiveCamera, width_px: number, height_px: number): void {
    const clearance = this.clearance;
    const shown = clearance !== null && this.object.visible;
    this.dot.visible = this.ring.visible = shown;
    if (!shown || clearance === null) {
      this.label.hidden = true;
      return;
    }
    this.object.position.set(...clearance.point_m);
    this.object.scale.setScalar(kMarkShare * camera.position.distanceTo(this.object.position));
    this.ring.quaternion.copy(camera.quaternion);
    const at = new Vector3(...clearance.point_m).project(camera);
    this.label.hidden = at.z > 1 || Math.abs(at.x) > 1 || Math.abs(at.y) > 1;
    setText(this.label, clearanceText(clearance));
    const x_px = Math.min(((at.x + 1) / 2) * width_px + 14, width_px - 180);
    const y_px = Math.max(((1 - at.y) / 2) * height_px - 30, 4);
    this.label.style.transform = `translate(${Math.round(x_px)}px, ${Math.round(y_px)}px)`;
  }
}

function clearanceText(clearance: Clearance): string {
  return `${inCm(clearance.distance_m)}  ${clearance.link} – ${clearance.object}`;
}
