// Which slice through the distance field is wished: asks the run for it, and says what there is of it.
import { byId, chooseButton, setText } from "./dom";
import type { History, Moment } from "./history";
import type { Axis, Grid, Point } from "./messages";

const kAsk_ms = 60;
const kAxes: readonly Axis[] = ["x", "y", "z"];

export class SliceControl {
  /** Told where the slice is wished to be, and the grid's two corners. */
  placed: (axis: Axis, position_m: number, low_m: Point, high_m: Point) => void = () => {};
  private axis: Axis = "z";
  /** Null until the grid is known. */
  private grid: Grid | null = null;
  private readonly position_m: Record<Axis, number | null> = { x: null, y: null, z: null };
  private ahead_s = 0;
  private shown = false;
  private timer = 0;
  private readonly slider = byId<HTMLInputElement>("slice-position");
  private readonly buttons = document.querySelectorAll<HTMLElement>("[data-axis]");

  /** `ask` sends a request to the run. */
  constructor(private readonly ask: (request: object) => void) {
    this.slider.addEventListener("input", () => this.move(Number(this.slider.value)));
    for (const button of this.buttons) {
      button.addEventListener("click", () => this.choose(button.dataset["axis"] as Axis));
    }
    this.slider.disabled = true;
  }

  /** Null for no slice. */
  request(): object {
    const position_m = this.position_m[this.axis];
    return { slice: this.shown && position_m !== null ? { axis: this.axis, position_m, ahead_s: this.ahead_s } : null };
  }

  lookAhead(ahead_s: number): void {
    this.ahead_s = ahead_s;
    this.askSoon();
  }

  toggle(shown: boolean): void {
    this.shown = shown;
    this.askSoon();
  }

  setGrid(grid: Grid | null): void {
    if (grid === null || grid === this.grid) return;
    this.grid = grid;
    for (const axis of kAxes) {
      const [low, high] = this.span(axis);
      // Half a metre above the ground, or through the middle.
      const first = axis === "z" ? 0.5 : (low + high) / 2;
      this.position_m[axis] = clamp(this.position_m[axis] ?? first, low, high);
    }
    this.slider.disabled = false;
    this.refresh();
    this.askSoon();
  }

  choose(axis: Axis): void {
    this.axis = axis;
    this.refresh();
    this.askSoon();
  }

  move(position_m: number): void {
    if (this.grid === null) return;
    this.position_m[this.axis] = clamp(position_m, ...this.span(this.axis));
    this.refresh();
    this.askSoon();
  }

  /** By whole voxels. */
  nudge(voxels: number): void {
    if (this.grid === null) return;
    this.move((this.position_m[this.axis] ?? 0) + voxels * this.grid.voxel_m);
  }

  show(moment: Moment, history: History, isLive: boolean): void {
    const slice = moment.slice;
    const legend = slice === null ? "" : `${slice.max_m.toFixed(1)} m and more`;
    setText(byId("ramp-end"), legend);
    setText(byId("slice-note"), this.noteOn(moment, history, isLive));
  }

  private noteOn(moment: Moment, history: History, isLive: boolean): string {
    const slice = moment.slice;
    if (!this.shown) return "Not shown; 5 turns it on.";
    if (slice === null) {
      return history.world.recorded ? "This recording has none." : "It comes with the next map.";
    }
    const wished_m = this.position_m[this.axis];
    const isThen = slice.ahead_s === null || slice.ahead_s === this.ahead_s;
    const isThere = slice.axis === this.axis && wished_m !== null && Math.abs(slice.position_m - wished_m) < 1e-3;
    if (isThere && isThen) return "";
    const then = isThen ? "" : `, ${(slice.ahead_s as number).toFixed(1)} s ahead`;
    const there = `${slice.axis} = ${slice.position_m.toFixed(2)} m${then}`;
    return isLive ? `Shown is ${there}; the next map brings yours.` : `Of this moment there is ${there} alone.`;
  }

  private span(axis: Axis): [number, number] {
    if (this.grid === null) return [0, 1];
    const i = kAxes.indexOf(axis);
    const half_m = this.grid.voxel_m / 2;
    const low = this.grid.origin_m[i] + half_m;
    return [low, this.grid.origin_m[i] + this.grid.voxel_m * this.grid.size_vox[i] - half_m];
  }

  private refresh(): void {
    const [low, high] = this.span(this.axis);
    const position_m = this.position_m[this.axis];
    chooseButton(this.buttons, (button) => button.dataset["axis"] === this.axis);
    if (this.grid === null || position_m === null) return;
    Object.assign(this.slider, { min: String(low), max: String(high), step: String(this.grid.voxel_m) });
    this.slider.value = String(position_m);
    setText(byId("slice-value"), `${position_m.toFixed(2)} m`);
    const { origin_m, voxel_m, size_vox } = this.grid;
    this.placed(this.axis, position_m, origin_m, origin_m.map((value, i) => value + voxel_m * size_vox[i]) as Point);
  }

  /** While it is dragged, only now and then. */
  private askSoon(): void {
    if (this.timer !== 0) return;
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      this.ask(this.request());
    }, kAsk_ms);
  }
}

function clamp(value: number, low: number, high: number): number {
  return Math.min(Math.max(value, low), high);
}
