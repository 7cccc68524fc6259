// Which moment is shown: the newest, one that stands still, or one that goes on.
import type { History } from "./history";

export type Mode = "live" | "paused" | "playing";

/** Below this, what is played has caught up with what comes in. */
const kCaughtUp_s = 0.02;

export class Playback {
  mode: Mode = "live";
  time_s = 0;
  speed = 1;
  private history: History | null = null;

  attach(history: History): void {
    const anew = this.history !== history;
    this.history = history;
    if (!anew) return;
    this.time_s = history.first_s;
    // A recording is there to be watched from its beginning.
    this.mode = history.world.recorded ? "playing" : "live";
  }

  /** After `elapsed_s` of wall time, or after something new came in. */
  tick(elapsed_s: number): void {
    const history = this.history;
    if (history === null) return;
    if (this.mode === "playing") this.time_s += elapsed_s * this.speed;
    if (this.mode === "live") this.time_s = history.last_s;
    if (this.mode === "playing" && this.time_s >= history.last_s - kCaughtUp_s) {
      // At the end of a live run, the newest is what comes next; a recording may still be coming in.
      if (!history.world.recorded) this.mode = "live";
      else if (history.end !== null) this.mode = "paused";
    }
    this.clamp();
  }

  pause(): void {
    this.mode = "paused";
  }

  toggle(): void {
    const history = this.history;
    if (history === null) return;
    if (this.mode !== "paused") return this.pause();
    const atEnd = this.time_s >= history.last_s - kCaughtUp_s;
    if (atEnd && history.world.recorded) this.time_s = history.first_s;
    this.mode = atEnd && !history.world.recorded ? "live" : "playing";
  }

  goLive(): void {
    const history = this.history;
    if (history === null) return;
    this.mode = history.world.recorded ? "paused" : "live";
    this.time_s = history.last_s;
  }

  /** Stands still at a time; goes on from there where it was playing. */
  seek(time_s: number): void {
    if (this.mode === "live") this.mode = "paused";
    this.time_s = time_s;
    this.clamp();
  }

  /** To the next or the last state that was told of. */
  step(direction: 1 | -1): void {
    const history = this.history;
    if (history === null) return;
    this.mode = "paused";
    const state = direction > 0 ? history.states.after(this.time_s) : history.states.before(this.time_s);
    if (state !== null) this.time_s = state.time_s;
    this.clamp();
  }

  private clamp(): void {
    const history = this.history;
    if (history === null) return;
    this.time_s = Math.min(Math.max(this.time_s, history.first_s), history.last_s);
  }
}
