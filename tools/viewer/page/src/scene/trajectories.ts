// Where tool and base go by a plan: the tool's line is the thicker one.
import { Group } from "three";
import { Line2 } from "three/addons/lines/Line2.js";
import { LineGeometry } from "three/addons/lines/LineGeometry.js";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import type { Moment } from "../history";
import type { Plan, World } from "../messages";
import type { Layer, Palette } from "./layer";

export type PlanRole = "followed" | "previous" | "refused";

interface Style {
  width_px: number;
  opacity: number;
  /** Lengths of dash and gap, metres; null for a line without gaps. */
  dash_m: [number, number] | null;
}

const kStyles: Record<PlanRole, Style> = {
  followed: { width_px: 4, opacity: 1, dash_m: null },
  previous: { width_px: 2.5, opacity: 0.8, dash_m: [0.06, 0.04] },
  refused: { width_px: 2.5, opacity: 0.95, dash_m: [0.02, 0.025] },
};

export class TrajectoryLayer implements Layer {
  readonly object = new Group();
  private readonly tool: Line2;
  private readonly base: Line2;
  private drawn: Plan | null = null;

  constructor(private readonly role: PlanRole) {
    const style = kStyles[role];
    this.tool = makeLine(style, 1);
    this.base = makeLine(style, 0.55);
    this.object.add(this.tool, this.base);
  }

  begin(_world: World): void {
    this.drawn = null;
    this.tool.visible = this.base.visible = false;
  }

  show(moment: Moment): void {
    const plan = moment[this.role];
    if (plan === this.drawn) return;
    this.drawn = plan;
    draw(this.tool, plan?.toolPath ?? null);
    draw(this.base, plan?.basePath ?? null);
  }

  recolour(palette: Palette): void {
    for (const line of [this.tool, this.base]) (line.material as LineMaterial).color.copy(palette[this.role]);
  }
}

function makeLine(style: Style, widthShare: number): Line2 {
  const material = new LineMaterial({
    linewidth: style.width_px * widthShare,
    dashed: style.dash_m !== null,
    transparent: style.opacity < 1,
    opacity: style.opacity,
  });
  if (style.dash_m !== null) [material.dashSize, material.gapSize] = style.dash_m;
  const line = new Line2(new LineGeometry(), material);
  line.frustumCulled = false;
  line.visible = false;
  line.renderOrder = 2;
  return line;
}

/** A path that stays where it is, as the base of an arm does, is no line. */
function hasLength(path: Float32Array): boolean {
  for (let i = 3; i < path.length; ++i) if (Math.abs(path[i] - path[i % 3]) > 1e-3) return true;
  return false;
}

function draw(line: Line2, path: Float32Array | null): void {
  line.visible = path !== null && hasLength(path);
  if (path === null || !line.visible) return;
  line.geometry.dispose();
  line.geometry = new LineGeometry();
  line.geometry.setPositions(path);
  line.computeLineDistances();
}
