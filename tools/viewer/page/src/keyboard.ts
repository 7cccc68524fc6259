// What keys do, and the sheet that says so.
import { byId, create } from "./dom";

export interface Binding {
  /** As KeyboardEvent.key has them. */
  keys: string[];
  /** For the sheet; bindings with the same text stand together. */
  shownAs: string;
  text: string;
  run(event: KeyboardEvent): void;
}

/** Keys that an element with the focus needs for itself. */
function isTaken(target: EventTarget | null, key: string): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target.tagName === "SELECT" || target.isContentEditable) return key !== "Escape";
  if (target instanceof HTMLInputElement && target.type === "number") return key !== "Escape";
  const isArrow = key.startsWith("Arrow") || key === "Home" || key === "End";
  if (target instanceof HTMLInputElement && target.type === "range") return isArrow && target.dataset["keys"] !== "page";
  // What was clicked at keeps the focus, but whoever presses a key then means the page.
  return (key === " " || key === "Enter") && target.matches("button, summary, input") && target.matches(":focus-visible");
}

export class Keyboard {
  private readonly help = byId<HTMLDialogElement>("help");

  constructor(private readonly bindings: readonly Binding[]) {
    document.addEventListener("keydown", (event) => this.press(event));
    byId("help-open").addEventListener("click", () => this.showHelp());
    const list = byId("help-keys");
    for (const { shownAs, text } of bindings.filter((one) => one.text !== "")) {
      list.append(create("kbd", "", shownAs), create("span", "", text));
    }
    list.append(create("kbd", "", "?"), create("span", "", "This sheet"));
  }

  showHelp(): void {
    if (!this.help.open) this.help.showModal();
  }

  private press(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey || this.help.open) return;
    if (event.key === "?") return this.showHelp();
    if (isTaken(event.target, event.key)) return;
    const binding = this.bindings.find((one) => one.keys.includes(event.key));
    if (binding === undefined) return;
    event.preventDefault();
    binding.run(event);
  }
}
