// The spheres that are edited, with what was before, step by step.
import type { Point, Sphere } from "../messages";

const kGrain_m = 1e-4;
const kLeastRadius_m = 1e-3;
const kMostSteps = 200;

/** To tenths of a millimetre, as they are saved. */
export function rounded(value_m: number): number {
  return Number((Math.round(value_m / kGrain_m) * kGrain_m).toFixed(4));
}

interface Step {
  spheres: readonly Sphere[];
  selected: number | null;
}

export class SphereDocument {
  /** Called after every change, of the selection as well. */
  changed: () => void = () => {};
  private now: Step = { spheres: [], selected: null };
  private saved: readonly Sphere[] = [];
  private past: Step[] = [];
  private future: Step[] = [];
  /** Changes of one drag or one press of a key are one step. */
  private gesture = "";

  get spheres(): readonly Sphere[] {
    return this.now.spheres;
  }
  get selected(): number | null {
    return this.now.selected;
  }
  get selectedSphere(): Sphere | null {
    return this.now.selected === null ? null : (this.now.spheres[this.now.selected] ?? null);
  }
  get isChanged(): boolean {
    return this.now.spheres !== this.saved;
  }
  get canUndo(): boolean {
    return this.past.length > 0;
  }
  get canRedo(): boolean {
    return this.future.length > 0;
  }

  load(spheres: readonly Sphere[]): void {
    this.now = { spheres, selected: null };
    this.saved = spheres;
    this.past = [];
    this.future = [];
    this.changed();
  }

  /** `spheres` are those that were sent: others may have come since. */
  markSaved(spheres: readonly Sphere[]): void {
    this.saved = spheres;
    this.changed();
  }

  select(index: number | null): void {
    this.gesture = "";
    if (index === this.now.selected) return;
    this.now = { ...this.now, selected: index };
    this.changed();
  }

  /** Successive changes of the same gesture are undone as one; "" is one of its own. */
  change(change: Partial<Sphere>, gesture = ""): void {
    const { selected, spheres } = this.now;
    const sphere = this.selectedSphere;
    if (sphere === null || selected === null) return;
    const next = tidy({ ...sphere, ...change });
    const isNext = gesture !== "" && gesture === this.gesture;
    this.put({ spheres: spheres.map((one, i) => (i === selected ? next : one)), selected }, isNext);
    this.gesture = gesture;
  }

  endGesture(): void {
    this.gesture = "";
  }

  /** Behind the last one of its link, and selected. */
  add(sphere: Sphere): void {
    const last = this.now.spheres.map((one) => one.link <= sphere.link).lastIndexOf(true);
    this.put({ spheres: [...this.now.spheres.slice(0, last + 1), tidy(sphere), ...this.now.spheres.slice(last + 1)], selected: last + 1 });
  }

  remove(): void {
    const { selected, spheres } = this.now;
    if (selected === null || spheres.length < 2) return;
    const left = spheres.filter((_, i) => i !== selected);
    const next = Math.min(selected, left.length - 1);
    const isSameLink = left[next].link === spheres[selected].link;
    this.put({ spheres: left, selected: isSameLink ? next : null });
  }

  replace(spheres: readonly Sphere[]): void {
    this.put({ spheres, selected: null });
  }

  undo(): void {
    this.go(this.past, this.future);
  }

  redo(): void {
    this.go(this.future, this.past);
  }

  private go(from: Step[], to: Step[]): void {
    const step = from.pop();
    if (step === undefined) return;
    to.push(this.now);
    this.now = step;
    this.gesture = "";
    this.changed();
  }

  private put(step: Step, continues = false): void {
    if (!continues) this.past.push(this.now);
    if (this.past.length > kMostSteps) this.past.shift();
    this.future = [];
    this.gesture = "";
    this.now = step;
    this.changed();
  }
}

function tidy({ link, centre_m, radius_m }: Sphere): Sphere {
  return { link, centre_m: centre_m.map(rounded) as Point, radius_m: Math.max(rounded(radius_m), kLeastRadius_m) };
}
