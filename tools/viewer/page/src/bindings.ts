// The keys of the page.
import type { App } from "./app";
import type { Binding } from "./keyboard";
import type { Axis } from "./messages";
import { kOverlays } from "./settings";

const kJump_s = 1;

export function bindings(app: App): Binding[] {
  const playback = app.playback;
  const act = (run: (event: KeyboardEvent) => void) => (event: KeyboardEvent) => {
    run(event);
    app.refresh();
  };
  const sideways = (direction: 1 | -1) =>
    act((event) => {
      if (event.shiftKey) playback.seek(playback.time_s + direction * kJump_s);
      else playback.step(direction);
    });
  return [
    { keys: [" "], shownAs: "space", text: "Pause or go on", run: act(() => playback.toggle()) },
    { keys: ["ArrowLeft"], shownAs: "← →", text: "A step back or on; with shift, a second", run: sideways(-1) },
    { keys: ["ArrowRight"], shownAs: "", text: "", run: sideways(1) },
    { keys: ["l"], shownAs: "l", text: "To the newest: live", run: act(() => playback.goLive()) },
    { keys: ["ArrowUp"], shownAs: "↑ ↓", text: "The slice a voxel on or back", run: act(() => app.slice.nudge(1)) },
    { keys: ["ArrowDown"], shownAs: "", text: "", run: act(() => app.slice.nudge(-1)) },
    ...(["x", "y", "z"] as Axis[]).map((axis, i) => ({
      ...{ keys: [axis], shownAs: i === 0 ? "x y z" : "", text: i === 0 ? "The axis across which the slice lies" : "" },
      run: act(() => app.slice.choose(axis)),
    })),
    { keys: ["["], shownAs: "[ ]", text: "The time ahead, half a second less or more", run: act(() => app.lookAhead(-0.5)) },
    { keys: ["]"], shownAs: "", text: "", run: act(() => app.lookAhead(0.5)) },
    { keys: ["r"], shownAs: "r", text: "The view as it was at first", run: () => app.choose("free") },
    { keys: ["f"], shownAs: "f", text: "Follow the robot", run: () => app.choose("follow") },
    { keys: ["t"], shownAs: "t", text: "From above", run: () => app.choose("top") },
    { keys: ["d"], shownAs: "d", text: "Light or dark", run: () => app.switchTheme() },
    ...kOverlays.map((overlay) => ({
      ...{ keys: [overlay.key], shownAs: overlay.key, text: overlay.hint },
      run: () => app.toggleOverlay(overlay.id),
    })),
  ];
}
