// One kind of thing that is drawn, which can be shown or not.
import type { Object3D } from "three";
import type { History, Moment } from "../history";
import type { World } from "../messages";
import type { Palette } from "./palette";

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
