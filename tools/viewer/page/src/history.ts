// What one episode has told: of a live run the last minute, of a recording all.
import { MapHistory } from "./map_history";
import { DepthFrame, End, FrameTiming, Message, Plan, RunEvent, Slice, State, StepTiming, Timing, Tracks, World } from "./messages";
import { Track } from "./track";

export const kWindow_s = 60;
/** By so much, what is told first may be older than what was told last. */
const kSlack_s = 1;

/** Of a live run; beyond it, the oldest goes first, whatever its age. */
export interface Budgets {
  map_bytes: number;
  frame_bytes: number;
  slice_bytes: number;
}

const kBudgets: Budgets = { map_bytes: 256e6, frame_bytes: 64e6, slice_bytes: 64e6 };

/** What a viewer shows of one moment. */
export interface Moment {
  time_s: number;
  state: State | null;
  tracks: Tracks | null;
  frame: DepthFrame | null;
  followed: Plan | null;
  previous: Plan | null;
  /** Until another plan is followed. */
  refused: Plan | null;
  slice: Slice | null;
  end: End | null;
}

export class History {
  readonly map = new MapHistory();
  readonly states = new Track<State>();
  readonly tracks = new Track<Tracks>();
  readonly frames = new Track<DepthFrame>((frame) => frame.depth_mm.byteLength);
  readonly followed = new Track<Plan>();
  readonly refused = new Track<Plan>();
  readonly slices = new Track<Slice>((slice) => slice.distance_mm.byteLength);
  readonly events = new Track<RunEvent>();
  readonly frameTimings = new Track<FrameTiming>();
  readonly stepTimings = new Track<StepTiming>();
  readonly timings = new Track<Timing>();
  end: End | null = null;
  /** The newest time that anything was told of. */
  last_s: number;
  private start_s: number;
  /** A map or a state has been told of: what came before is not known here. */
  private begun = false;
  private pruned_s = -Infinity;

  constructor(
    readonly world: World,
    private readonly budgets: Budgets = kBudgets,
  ) {
    this.start_s = world.time_s;
    this.last_s = world.time_s;
  }

  /** The earliest moment that can be shown. */
  get first_s(): number {
    return this.start_s;
  }

  /** Whether `world` may tell of this episode again, as after a lost connection. */
  continues(world: World): boolean {
    if (world.identity !== this.world.identity) return false;
    return world.time_s === this.world.time_s || world.time_s >= this.last_s - kSlack_s;
  }

  /** Whether a message shows that time has begun anew. */
  isFromBefore(message: Message): boolean {
    const isNow = message.kind === "state" || message.kind === "map";
    return !this.world.recorded && isNow && message.time_s < this.last_s - kSlack_s;
  }

  add(message: Message): void {
    if (message.kind !== "world") this.keep(message);
    if (!this.begun && (message.kind === "state" || message.kind === "map")) {
      this.begun = true;
      this.start_s = message.time_s;
    }
    this.last_s = Math.max(this.last_s, message.time_s);
    if (this.last_s > this.pruned_s + 1) this.prune();
  }

  at(time_s: number): Moment {
    const followed = this.followed.at(time_s);
    const refused = this.refused.at(time_s);
    return {
      time_s,
      state: this.states.at(time_s),
      tracks: this.tracks.at(time_s),
      frame: this.frames.at(time_s),
      followed,
      previous: this.followed.at(time_s, 1),
      refused: refused !== null && refused.time_s >= (followed?.time_s ?? -Infinity) ? refused : null,
      slice: this.slices.at(time_s),
      end: this.end !== null && this.end.time_s <= time_s ? this.end : null,
    };
  }

  private keep(message: Exclude<Message, World>): void {
    switch (message.kind) {
      case "map":
        return this.map.add(message);
      case "state":
        return this.states.put(message);
      case "tracks":
        return this.tracks.put(message);
      case "frame":
        return this.frames.put(message);
      case "plan":
        return (message.role === "followed" ? this.followed : this.refused).put(message);
      case "event":
        return this.keepEvent(message);
      case "timing":
        return this.keepTiming(message);
      case "slice":
        return this.slices.put(message);
      case "end":
        this.end = message;
    }
  }

  /** Whoever connects again is told the newest event again. */
  private keepEvent(event: RunEvent): void {
    const text = JSON.stringify(event);
    const known = this.events.items.some((one) => one.time_s === event.time_s && JSON.stringify(one) === text);
    if (!known) this.events.add(event);
  }

  private keepTiming(timing: Timing): void {
    this.timings.put(timing);
    for (const frame of timing.frames) this.frameTimings.put(frame);
    for (const step of timing.steps) this.stepTimings.put(step);
  }

  private prune(): void {
    this.pruned_s = this.last_s;
    if (this.world.recorded) return;
    this.frames.forgetBeyond(this.budgets.frame_bytes);
    this.slices.forgetBeyond(this.budgets.slice_bytes);
    this.forgetBefore(this.last_s - kWindow_s);
    // A map that changes a lot shortens the window.
    while (this.map.bytes > this.budgets.map_bytes && this.start_s < this.last_s - 2) {
      this.forgetBefore(this.start_s + 1);
    }
  }

  private forgetBefore(time_s: number): void {
    if (time_s <= this.start_s) return;
    this.start_s = time_s;
    this.map.forgetBefore(time_s);
    for (const track of [this.states, this.tracks, this.frames, this.refused, this.slices, this.timings] as Track<Message>[]) {
      track.forgetBefore(time_s);
    }
    this.followed.forgetBefore(time_s, 2);
    this.events.forgetBefore(time_s, 0);
    this.frameTimings.forgetBefore(time_s, 0);
    this.stepTimings.forgetBefore(time_s, 0);
  }
}
