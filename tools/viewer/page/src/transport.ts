// The buttons and the slider that say which moment is shown.
import { byId, setText } from "./dom";
import type { History } from "./history";
import type { Playback } from "./playback";

export class Transport {
  private readonly scrub = byId<HTMLInputElement>("scrub");

  /** `changed` is called after each of the user's wishes. */
  constructor(
    private readonly playback: Playback,
    changed: () => void,
  ) {
    const act = (id: string, run: () => void) =>
      byId(id).addEventListener("click", () => {
        run();
        changed();
      });
    act("play", () => playback.toggle());
    act("step-back", () => playback.step(-1));
    act("step-on", () => playback.step(1));
    act("live", () => playback.goLive());
    this.scrub.addEventListener("input", () => {
      playback.seek(Number(this.scrub.value));
      changed();
    });
    const speed = byId<HTMLSelectElement>("speed");
    speed.addEventListener("change", () => {
      playback.speed = Number(speed.value);
    });
  }

  show(history: History): void {
    const { mode, time_s } = this.playback;
    Object.assign(this.scrub, { min: String(history.first_s), max: String(history.last_s) });
    this.scrub.value = String(time_s);
    const behind_s = history.last_s - time_s;
    const clock = behind_s > 0.05 ? `${time_s.toFixed(2)} s  (−${behind_s.toFixed(1)})` : `${time_s.toFixed(2)} s`;
    setText(byId("clock"), clock);
    this.scrub.setAttribute("aria-valuetext", clock);
    document.documentElement.dataset["mode"] = mode;
    const play = byId("play");
    play.setAttribute("aria-label", mode === "paused" ? "Play" : "Pause");
    const live = byId("live");
    setText(live, history.world.recorded ? "To the end" : "Live");
    live.setAttribute("aria-pressed", String(mode === "live"));
  }
}
