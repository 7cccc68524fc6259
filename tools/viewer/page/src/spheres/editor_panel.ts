// The figures and fields beside the scene.
import { byId, create, setText } from "../dom";
import type { Point, Sphere, World } from "../messages";
import type { Cover, RobotCover } from "./desk";

export interface PanelActs {
  select(index: number): void;
  chooseLink(link: number | null): void;
  change(change: Partial<Sphere>, gesture: string): void;
  endGesture(): void;
}

const kAxes = ["x", "y", "z"] as const;

export class EditorPanel {
  private readonly rows = new Map<number, HTMLTableRowElement>();
  private readonly centre = kAxes.map((axis) => byId<HTMLInputElement>(`centre-${axis}`));
  private readonly radius = byId<HTMLInputElement>("radius");
  private readonly slider = byId<HTMLInputElement>("radius-slider");
  private links: string[] = [];
  private listed = "";

  constructor(private readonly acts: PanelActs) {
    for (const input of this.centre) {
      input.addEventListener("input", () => this.readFields());
      input.addEventListener("change", () => acts.endGesture());
    }
    for (const input of [this.radius, this.slider]) {
      input.addEventListener("input", () => acts.change({ radius_m: Number(input.value) / 1000 }, "radius"));
      input.addEventListener("change", () => acts.endGesture());
    }
    byId("all-links").addEventListener("click", () => acts.chooseLink(null));
  }

  /** Links that have shapes or spheres. */
  begin(world: World): void {
    this.links = world.links;
    this.rows.clear();
    this.listed = "";
    const used = new Set([...world.shapes, ...world.spheres].map((one) => one.link));
    byId("links").replaceChildren(...[...used].sort((a, b) => a - b).map((link) => this.linkRow(link)));
  }

  show(spheres: readonly Sphere[], selected: number | null, link: number | null): void {
    for (const [one, row] of this.rows) row.setAttribute("aria-selected", String(one === link));
    byId("all-links").setAttribute("aria-pressed", String(link === null));
    this.listSpheres(spheres, selected, link);
    this.showFields(selected === null ? null : (spheres[selected] ?? null));
  }

  showCover(cover: RobotCover): void {
    for (const one of cover.links) {
      const row = this.rows.get(one.link);
      if (row !== undefined) fill([...row.cells].slice(1), one);
    }
    fill([...byId<HTMLTableRowElement>("whole").cells].slice(1), cover.whole);
    const { whole } = cover;
    setText(byId("gap"), whole.gap_m > 0 ? `${(1000 * whole.gap_m).toFixed(1)} mm` : "none");
    setText(byId("protrusion"), `${(1000 * whole.protrusion_m).toFixed(0)} mm`);
    setText(byId("excess"), `${(1000 * whole.excess_m3).toFixed(1)} l over ${(1000 * whole.shapes_m3).toFixed(1)} l of shapes`);
    byId("gap").dataset["tone"] = whole.gap_m > 0 ? "bad" : "good";
  }

  private linkRow(link: number): HTMLTableRowElement {
    const row = create("tr");
    const name = create("td");
    const button = create("button", "link-name", this.links[link]);
    button.type = "button";
    button.title = this.links[link];
    button.addEventListener("click", () => this.acts.chooseLink(link));
    name.append(button);
    row.append(name, ...[1, 2, 3, 4].map(() => create("td")));
    this.rows.set(link, row);
    return row;
  }

  private listSpheres(spheres: readonly Sphere[], selected: number | null, link: number | null): void {
    const select = byId<HTMLSelectElement>("sphere-list");
    const shown = spheres.map((sphere, i) => ({ sphere, i })).filter(({ sphere }) => link === null || sphere.link === link);
    const texts = shown.map(({ sphere, i }) => `${i + 1}  ${this.links[sphere.link]}  ${(1000 * sphere.radius_m).toFixed(1)} mm`);
    const listed = texts.join("\n");
    if (listed !== this.listed) {
      this.listed = listed;
      select.replaceChildren(...shown.map(({ i }, row) => Object.assign(create("option", "", texts[row]), { value: String(i) })));
    }
    select.selectedIndex = shown.findIndex(({ i }) => i === selected);
    setText(byId("sphere-count"), String(shown.length));
  }

  private showFields(sphere: Sphere | null): void {
    byId<HTMLFieldSetElement>("sphere-fields").disabled = sphere === null;
    const values = sphere === null ? ["", "", ""] : sphere.centre_m.map((value) => (1000 * value).toFixed(1));
    this.centre.forEach((input, i) => put(input, values[i]));
    put(this.radius, sphere === null ? "" : (1000 * sphere.radius_m).toFixed(1));
    put(this.slider, sphere === null ? "50" : (1000 * sphere.radius_m).toFixed(1));
    setText(byId("sphere-link"), sphere === null ? "none selected" : `on ${this.links[sphere.link]}`);
  }

  private readFields(): void {
    const centre_m = this.centre.map((input) => Number(input.value) / 1000);
    const isWhole = this.centre.every((input) => input.value !== "" && Math.abs(Number(input.value)) <= 1e5);
    if (isWhole) this.acts.change({ centre_m: centre_m as Point }, "centre");
  }
}

function fill(cells: HTMLElement[], cover: Cover): void {
  const texts = [
    String(cover.spheres),
    percent(cover.surfaceShare),
    `${(1000 * cover.excess_m3).toFixed(2)}`,
    `${(1000 * cover.protrusion_m).toFixed(0)}`,
  ];
  cells.forEach((cell, i) => setText(cell, texts[i]));
  cells[1].dataset["tone"] = cover.gap_m > 0 ? "bad" : "good";
}

/** Nothing that is not whole is called 100 %. */
function percent(share: number): string {
  return share >= 1 ? "100" : Math.min(99.9, 100 * share).toFixed(1);
}

/** A field that is being typed into is left alone. */
function put(input: HTMLInputElement, value: string): void {
  if (document.activeElement !== input || input.type === "range") input.value = value;
}
