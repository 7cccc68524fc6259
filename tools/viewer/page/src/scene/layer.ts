// What is drawn, kind by kind, and in which colours.
import { Color, type Object3D } from "three";
import type { History, Moment } from "../history";
import type { World } from "../messages";

// Colours of the scene are those of the style sheet, so that light and dark live in one place.
const kNames = [
  "scene-top", "scene-bottom", "ground", "robot", "robot-edge", "spheres", "unknown", "followed", "previous",
  "refused", "swept-first", "swept-last", "moving", "track", "predicted", "fixed", "goal", "camera", "clearance",
  "voxel-low", "voxel-middle", "voxel-high", "voxel-edge",
  "distance-0", "distance-1", "distance-2", "distance-3", "unseen",
] as const;
export type ColourName = (typeof kNames)[number];

export type Palette = Record<ColourName, Color>;

/** As the page's theme has them now. */
export function readPalette(): Palette {
  const style = getComputedStyle(document.documentElement);
  const colours = kNames.map((name) => [name, new Color(style.getPropertyValue(`--${name}`).trim() || "#888")]);
  return Object.fromEntries(colours) as Palette;
}

/** One kind of thing that is drawn, which can be shown or not. */
export interface Layer {
  readonly object: Object3D;
  /** Another episode: forget the last one. */
  begin(world: World): void;
  /** Called for what is not shown as well; `history` is the moment's. */
  show(moment: Moment, history: History): void;
  recolour(palette: Palette): void;
  /** The layer is shown from now on, or no longer. */
  toggle?(shown: boolean): void;
}
