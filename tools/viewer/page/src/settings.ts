// What the viewer remembers of its user, in this browser alone.

export interface Overlay {
  id: string;
  label: string;
  /** What it is, in a sentence. */
  hint: string;
  /** The key that turns it on and off. */
  key: string;
  shown: boolean;
}

/** In the order of the panel; `shown` is what a new user sees. */
export const kOverlays: readonly Overlay[] = [
  { id: "robot", label: "Robot", key: "1", shown: true, hint: "The robot, by the shapes that it is checked with" },
  { id: "spheres", label: "Spheres", key: "2", shown: false, hint: "The spheres that plans keep clear with" },
  { id: "voxels", label: "Voxels", key: "3", shown: true, hint: "Occupied voxels, coloured by height" },
  { id: "unknown", label: "Unknown", key: "4", shown: false, hint: "Where known free space ends and nobody has looked yet" },
  { id: "slice", label: "Distance slice", key: "5", shown: false, hint: "A slice through the distance field" },
  { id: "followed", label: "Current plan", key: "6", shown: true, hint: "The trajectory that is followed: tool thick, base thin" },
  { id: "previous", label: "Previous plan", key: "7", shown: true, hint: "The trajectory that was followed before" },
  { id: "refused", label: "Refused plan", key: "8", shown: true, hint: "The last trajectory that was found and turned down" },
  { id: "swept", label: "Swept volume", key: "9", shown: false, hint: "What the robot will pass through" },
  { id: "tracks", label: "Tracks", key: "k", shown: true, hint: "What is tracked: a cylinder, its number, and how far it goes in a second" },
  { id: "predicted", label: "Predictions", key: "p", shown: true, hint: "Where what is tracked may be, fading with time, and at the time ahead" },
  { id: "moving", label: "Moving (truth)", key: "0", shown: true, hint: "Moving obstacles as they truly are, in simulation" },
  { id: "fixed", label: "Fixed (truth)", key: "o", shown: false, hint: "Fixed objects as they truly are, in simulation" },
  { id: "goal", label: "Goal", key: "g", shown: true, hint: "Where the robot is to end up" },
  { id: "camera", label: "Camera", key: "c", shown: true, hint: "The camera's frustum, what it measured, and the depth image" },
  { id: "clearance", label: "Clearance", key: "m", shown: true, hint: "Where robot and obstacle are closest" },
];

export type Theme = "light" | "dark";

/** Storage may be full or forbidden: then nothing is remembered. */
function recall(key: string): string | null {
  try {
    return window.localStorage.getItem(`sidestep.${key}`);
  } catch {
    return null;
  }
}

function remember(key: string, value: string): void {
  try {
    window.localStorage.setItem(`sidestep.${key}`, value);
  } catch {
    // Not remembered, then.
  }
}

export function overlayShown(overlay: Overlay): boolean {
  const value = recall(`overlay.${overlay.id}`);
  return value === null ? overlay.shown : value === "on";
}

export function rememberOverlay(id: string, shown: boolean): void {
  remember(`overlay.${id}`, shown ? "on" : "off");
}

/** The chosen one, or null where the system's is to be used. */
export function chosenTheme(): Theme | null {
  const value = recall("theme");
  return value === "light" || value === "dark" ? value : null;
}

export function rememberTheme(theme: Theme): void {
  remember("theme", theme);
}

/** The chosen theme, or the system's. */
export function currentTheme(): Theme {
  return chosenTheme() ?? (window.matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
}

/** Applies the theme, now and when it changes; the button switches it. Returns what the button does. */
export function followTheme(button: HTMLElement, changed: () => void): () => void {
  const apply = () => {
    document.documentElement.dataset["theme"] = currentTheme();
  };
  const update = () => {
    apply();
    changed();
  };
  const change = () => {
    rememberTheme(currentTheme() === "dark" ? "light" : "dark");
    update();
  };
  apply();
  button.addEventListener("click", change);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", update);
  return change;
}
