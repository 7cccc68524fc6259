// The space that the robot's spheres will pass through by the current plan: what lies behind is gone,
// what comes last is the most faint.
import { Color, Group, IcosahedronGeometry, InstancedMesh, MeshBasicMaterial } from "three";
import type { Moment } from "../history";
import type { Plan, World } from "../messages";
import { dispose } from "./geometry";
import type { Layer, Palette } from "./layer";
import { placeSpheres } from "./robot";

export class SweptLayer implements Layer {
  readonly object = new Group();
  private world: World | null = null;
  private plan: Plan | null = null;
  private mesh: InstancedMesh | null = null;
  private first = new Color();
  private last = new Color();

  begin(world: World): void {
    this.world = world;
    this.draw(null);
  }

  show(moment: Moment): void {
    if (moment.followed !== this.plan) this.draw(moment.followed);
    if (this.mesh === null || this.plan === null || this.world === null) return;
    // Instances stand in reverse order of time.
    const since_s = moment.time_s - this.plan.start_s;
    const ahead = this.plan.swept_s.filter((time_s) => time_s >= since_s).length;
    this.mesh.count = ahead * this.world.spheres.length;
  }

  recolour(palette: Palette): void {
    this.first = palette["swept-first"];
    this.last = palette["swept-last"];
    this.draw(this.plan);
  }

  private draw(plan: Plan | null): void {
    dispose(this.object);
    this.plan = plan;
    this.mesh = null;
    if (plan === null || this.world === null || plan.swept_s.length === 0) return;
    const [perTime, times] = [this.world.spheres.length, plan.swept_s.length];
    const material = new MeshBasicMaterial({ transparent: true, opacity: 0.07, depthWrite: false });
    const mesh = new InstancedMesh(new IcosahedronGeometry(1, 1), material, perTime * times);
    const colour = new Color();
    for (let time = 0; time < times; ++time) {
      const first = perTime * (times - 1 - time);
      placeSpheres(mesh, first, this.world, plan.sweptPoses, 7 * this.world.links.length * time);
      colour.copy(this.first).lerp(this.last, times > 1 ? time / (times - 1) : 0);
      for (let i = 0; i < perTime; ++i) mesh.setColorAt(first + i, colour);
    }
    mesh.frustumCulled = false;
    mesh.renderOrder = 1;
    this.mesh = mesh;
    this.object.add(mesh);
  }
}
