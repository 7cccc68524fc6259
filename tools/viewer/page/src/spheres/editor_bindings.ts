// The keys of the sphere editor.
import type { Binding } from "../keyboard";
import type { EditorApp } from "./editor_app";

const kStep_m = 0.005;
const kFineStep_m = 0.001;

export function editorBindings(app: EditorApp): Binding[] {
  const step = (event: KeyboardEvent) => (event.shiftKey ? kFineStep_m : kStep_m);
  const nudge = (axis: number, sign: 1 | -1) => (event: KeyboardEvent) => app.nudge(axis, sign * step(event));
  const binding = (keys: string[], shownAs: string, text: string, run: Binding["run"]) => ({ keys, shownAs, text, run });
  return [
    binding(["n"], "n p", "The next sphere, or the one before", () => app.step(1)),
    binding(["p"], "", "", () => app.step(-1)),
    binding(["ArrowRight"], "← →", "Along x of its link, 5 mm; with shift 1 mm", nudge(0, 1)),
    binding(["ArrowLeft"], "", "", nudge(0, -1)),
    binding(["ArrowUp"], "↑ ↓", "Along y", nudge(1, 1)),
    binding(["ArrowDown"], "", "", nudge(1, -1)),
    binding(["PageUp"], "PgUp PgDn", "Along z", nudge(2, 1)),
    binding(["PageDown"], "", "", nudge(2, -1)),
    binding(["+", "="], "+ -", "Larger, smaller, 5 mm", () => app.grow(kStep_m)),
    binding(["-", "_"], "", "", () => app.grow(-kStep_m)),
    binding(["m"], "m s", "Move, or size, with the handles in the scene", () => app.chooseTool("move")),
    binding(["s"], "", "", () => app.chooseTool("resize")),
    binding(["a"], "a", "Add a sphere", () => app.add()),
    binding(["Delete", "Backspace"], "Del", "Remove it", () => app.document.remove()),
    binding(["z", "u"], "z y", "Undo, do again", () => app.document.undo()),
    binding(["y"], "", "", () => app.document.redo()),
    binding(["f"], "f", "Fit", () => app.fit()),
    binding(["w"], "w", "Write the profile", () => app.save()),
    binding(["Escape"], "Esc", "Select none", () => app.document.select(null)),
    binding(["r"], "r", "The view as it was at first", () => app.stage?.room.views.reset()),
    binding(["d"], "d", "Light or dark", () => app.switchTheme()),
  ];
}
