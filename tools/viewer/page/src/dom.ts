// Short hands for the document.

/** The element of index.html with this id. */
export function byId<T extends HTMLElement>(id: string): T {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`index.html has no #${id}`);
  return element as T;
}

export function create<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  className = "",
  text = "",
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (className !== "") element.className = className;
  if (text !== "") element.textContent = text;
  return element;
}

/** Leaves alone what says so already: screen readers speak of changes. */
export function setText(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** The buttons of one group, of which one is pressed. */
export function chooseButton(buttons: Iterable<HTMLElement>, isChosen: (button: HTMLElement) => boolean): void {
  for (const button of buttons) button.setAttribute("aria-pressed", String(isChosen(button)));
}

/** With a minus that is one, as in "−1.2 cm". */
export function inCm(distance_m: number): string {
  return `${(100 * distance_m).toFixed(1).replace("-", "\u2212")} cm`;
}
