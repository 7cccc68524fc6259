// What is tracked, and where it may be in the seconds to come.
import {
  BufferAttribute,
  BufferGeometry,
  CanvasTexture,
  Color,
  CylinderGeometry,
  DoubleSide,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  Sprite,
  SpriteMaterial,
  SRGBColorSpace,
} from "three";
import type { Moment } from "../history";
import type { PredictedSet, Track, Tracks, World } from "../messages";
import { dispose } from "./geometry";
import type { Layer, Palette } from "./layer";

/** Between two discs of a fan. */
const kFanStep_s = 0.5;
const kFanOpacity = 0.16;
const kCorners = 40;
/** Above the ground's lines. */
const kLift_m = 0.01;

/** A cylinder that one sees through. */
function cylinder(x_m: number, y_m: number, radius_m: number, bottom_m: number, top_m: number, colour: Color): Object3D {
  const height_m = Math.max(top_m - bottom_m, kLift_m);
  const geometry = new CylinderGeometry(radius_m, radius_m, height_m, kCorners).rotateX(Math.PI / 2);
  const face = new MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.14, depthWrite: false });
  const edge = new LineBasicMaterial({ color: colour });
  const body = new Group();
  body.add(new Mesh(geometry, face), new LineSegments(new EdgesGeometry(geometry, 30), edge));
  body.position.set(x_m, y_m, bottom_m + height_m / 2);
  return body;
}

/** As long as the way of a second, flat. */
function arrow({ position_m: [x, y], velocity_mps: [vx, vy], top_m }: Track, colour: Color): Object3D {
  const length = Math.hypot(vx, vy);
  const [head, half] = [Math.min(0.22, 0.5 * length), 0.025];
  const neck = length - head;
  const outline = [0, half, 0, -half, neck, -half, neck, half, neck, -4 * half, length, 0, neck, 4 * half];
  const corners = Array.from({ length: 7 }, (_, i) => [outline[2 * i], outline[2 * i + 1], 0]).flat();
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(Float32Array.from(corners), 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3, 4, 5, 6]);
  const body = new Mesh(geometry, new MeshBasicMaterial({ color: colour, side: DoubleSide }));
  body.position.set(x, y, top_m + kLift_m);
  body.rotation.z = Math.atan2(vy, vx);
  return body;
}

function label({ id, position_m: [x, y], top_m }: Track, colour: Color): Object3D {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [128, 64];
  const context = canvas.getContext("2d") as CanvasRenderingContext2D;
  context.font = "bold 52px sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = `#${colour.getHexString()}`;
  context.fillText(String(id), 64, 34);
  const map = new CanvasTexture(canvas);
  map.colorSpace = SRGBColorSpace;
  const material = new SpriteMaterial({ map, depthTest: false });
  material.addEventListener("dispose", () => map.dispose());
  const sprite = new Sprite(material);
  sprite.scale.set(0.4, 0.2, 1);
  sprite.position.set(x, y, top_m + 0.25);
  sprite.renderOrder = 9;
  return sprite;
}

/** Drawn anew with every message of tracks, and when what it looks like changes. */
abstract class PeopleLayer implements Layer {
  readonly object = new Group();
  protected colour = new Color();
  protected told: Tracks | null = null;

  constructor(private readonly colourName: "track" | "predicted") {}

  begin(_world: World): void {
    this.told = null;
    this.redraw();
  }

  show(moment: Moment): void {
    if (moment.tracks === this.told) return;
    this.told = moment.tracks;
    this.redraw();
  }

  recolour(palette: Palette): void {
    this.colour = palette[this.colourName];
    this.redraw();
  }

  protected redraw(): void {
    dispose(this.object);
    if (this.told !== null) this.draw(this.told);
  }

  protected abstract draw(told: Tracks): void;
}

export class TracksLayer extends PeopleLayer {
  constructor() {
    super("track");
  }

  protected override draw({ tracks }: Tracks): void {
    for (const track of tracks) {
      const [x, y] = track.position_m;
      this.object.add(cylinder(x, y, track.radius_m, track.bottom_m, track.top_m, this.colour));
      this.object.add(arrow(track, this.colour), label(track, this.colour));
    }
  }
}

interface Disc {
  x_m: number;
  y_m: number;
  radius_m: number;
}

/** Where a set is at a time; null before its first knot and after its last one. */
export function discAt({ knots }: PredictedSet, time_s: number): Disc | null {
  const next = knots.findIndex((knot) => knot.time_s >= time_s);
  if (next < 0 || (next === 0 && knots[0].time_s > time_s)) return null;
  const [a, b] = [knots[Math.max(0, next - 1)], knots[next]];
  const share = next === 0 ? 0 : (time_s - a.time_s) / (b.time_s - a.time_s);
  const between = (from: number, to: number) => from + share * (to - from);
  return {
    x_m: between(a.centre_m[0], b.centre_m[0]),
    y_m: between(a.centre_m[1], b.centre_m[1]),
    radius_m: between(a.radius_m, b.radius_m),
  };
}

export class PredictedLayer extends PeopleLayer {
  private ahead_s = 0;

  constructor() {
    super("predicted");
  }

  lookAhead(ahead_s: number): void {
    this.ahead_s = ahead_s;
    this.redraw();
  }

  protected override draw({ time_s, sets }: Tracks): void {
    if (sets.length === 0) return;
    this.object.add(this.fans(time_s, sets));
    if (this.ahead_s === 0) return;
    for (const set of sets) {
      const disc = discAt(set, time_s + this.ahead_s);
      if (disc === null) continue;
      this.object.add(cylinder(disc.x_m, disc.y_m, disc.radius_m, set.bottom_m, set.top_m, this.colour));
    }
  }

  /** Discs on the floor, the later the fainter, and the less likely. */
  private fans(time_s: number, sets: readonly PredictedSet[]): Object3D {
    const end_s = Math.max(...sets.map(({ knots }) => knots[knots.length - 1]?.time_s ?? time_s));
    const [positions, colours]: [number[], number[]] = [[], []];
    const corner = (x: number, y: number, z: number, opacity: number) => {
      positions.push(x, y, z);
      colours.push(this.colour.r, this.colour.g, this.colour.b, opacity);
    };
    for (let at_s = time_s; at_s <= end_s; at_s += kFanStep_s) {
      const left = 1 - (at_s - time_s) / (end_s - time_s + kFanStep_s);
      for (const set of sets) {
        const disc = discAt(set, at_s);
        if (disc === null) continue;
        const [z, opacity] = [set.bottom_m + kLift_m, kFanOpacity * left * set.likelihood];
        const rim = (i: number) => {
          const turn = (2 * Math.PI * i) / kCorners;
          corner(disc.x_m + disc.radius_m * Math.cos(turn), disc.y_m + disc.radius_m * Math.sin(turn), z, opacity);
        };
        for (let i = 0; i < kCorners; ++i) {
          corner(disc.x_m, disc.y_m, z, opacity);
          rim(i);
          rim(i + 1);
        }
      }
    }
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(Float32Array.from(positions), 3));
    geometry.setAttribute("color", new BufferAttribute(Float32Array.from(colours), 4));
    const material = new MeshBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false });
    return new Mesh(geometry, material);
  }
}
