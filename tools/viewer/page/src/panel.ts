// The figures beside the scene: what is shown, joints, events.
import { byId, create, inCm, setText } from "./dom";
import type { History, Moment } from "./history";
import type { Joint, RunEvent, World } from "./messages";
import { kOverlays, Overlay } from "./settings";

const kMostEvents = 200;

export class Panel {
  private readonly facts = byId("facts");
  private readonly values = new Map<string, HTMLElement>();
  private readonly joints: { bar: HTMLElement; value: HTMLElement; joint: Joint }[] = [];
  private readonly boxes = new Map<string, HTMLInputElement>();
  private listed: RunEvent | null = null;
  private listedCount = 0;

  constructor(
    private readonly toggled: (id: string, shown: boolean) => void,
    private readonly seek: (time_s: number) => void,
  ) {
    for (const overlay of kOverlays) this.addOverlay(overlay);
  }

  begin(world: World): void {
    this.listed = null;
    this.listedCount = 0;
    byId("events").replaceChildren();
    this.joints.length = 0;
    const list = byId("joints");
    list.replaceChildren();
    for (const joint of world.joints) this.addJoint(list, joint);
  }

  check(id: string, shown: boolean): void {
    const box = this.boxes.get(id);
    if (box !== undefined) box.checked = shown;
  }

  show(moment: Moment, history: History): void {
    const { world } = history;
    const clearance = moment.state?.clearance ?? null;
    const timing = history.timings.at(moment.time_s);
    const frame = moment.frame;
    this.fact("Robot", world.robot);
    this.fact("Clearance", clearance === null ? "–" : inCm(clearance.distance_m), "clearance");
    this.fact("between", clearance === null ? "–" : `${clearance.link} – ${clearance.object}`);
    this.fact("Plan", planText(moment));
    this.fact("Depth image", frame === null ? "–" : `${Math.round(1000 * (moment.time_s - frame.stamp_s))} ms old`);
    this.fact("Checks", timing === null ? "–" : timing.checks.toLocaleString("en"));
    this.fact("Frames dropped", timing === null ? "–" : String(timing.framesDropped));
    this.showJoints(moment);
    this.listEvents(history, moment.time_s);
  }

  private fact(name: string, text: string, kind = ""): void {
    let value = this.values.get(name);
    if (value === undefined) {
      value = create("dd", kind);
      this.facts.append(create("dt", "", name), value);
      this.values.set(name, value);
    }
    setText(value, text);
    value.title = text;
  }

  private addOverlay({ id, label, key, hint }: Overlay): void {
    const box = create("input");
    box.type = "checkbox";
    box.id = `overlay-${id}`;
    box.addEventListener("change", () => this.toggled(id, box.checked));
    this.boxes.set(id, box);
    const row = create("label", "overlay");
    row.title = `${hint} (${key})`;
    const swatch = create("span", "swatch");
    swatch.dataset["overlay"] = id;
    row.append(box, swatch, create("span", "overlay-name", label));
    byId("overlays").append(row);
  }

  private addJoint(list: HTMLElement, joint: Joint): void {
    const name = create("span", "joint-name", joint.name);
    name.title = joint.name;
    const bar = create("span", "joint-bar");
    const mark = create("span", "joint-mark");
    bar.append(mark);
    const value = create("span", "joint-value", "–");
    list.append(name, bar, value);
    this.joints.push({ bar: mark, value, joint });
  }

  private showJoints(moment: Moment): void {
    const q = moment.state?.q ?? [];
    this.joints.forEach(({ bar, value, joint }, i) => {
      setText(value, i < q.length ? `${q[i].toFixed(3)} ${joint.unit}` : "–");
      const span = joint.lower === null || joint.upper === null ? 0 : joint.upper - joint.lower;
      bar.hidden = i >= q.length || span <= 0;
      if (bar.hidden) return;
      const share = Math.min(1, Math.max(0, (q[i] - (joint.lower as number)) / span));
      bar.style.left = `${(100 * share).toFixed(1)}%`;
    });
  }

  /** Newest first; what is later than the moment that is shown stands back. */
  private listEvents(history: History, time_s: number): void {
    const events = history.events.items;
    const list = byId("events");
    if (events.length !== this.listedCount || history.events.last !== this.listed) {
      this.listedCount = events.length;
      this.listed = history.events.last;
      list.replaceChildren(...events.slice(-kMostEvents).reverse().map((event) => this.eventItem(event)));
      setText(byId("event-count"), events.length > 0 ? String(events.length) : "");
    }
    for (const item of list.children) {
      item.classList.toggle("later", Number((item as HTMLElement).dataset["time"]) > time_s + 1e-9);
    }
  }

  private eventItem(event: RunEvent): HTMLElement {
    const item = create("li");
    item.dataset["time"] = String(event.time_s);
    const button = create("button", "event");
    button.type = "button";
    const name = create("span", "event-name", event.event.replace(/_/g, " "));
    name.dataset["event"] = event.event;
    const solve = (event.solve_ms ?? 0) > 0 ? `${(event.solve_ms as number).toFixed(1)} ms` : "";
    button.append(create("span", "event-time", event.time_s.toFixed(2)), name, create("span", "event-solve", solve));
    const text = [event.cause || event.reason, event.guess && `from the guess ${event.guess}`].filter(Boolean).join("; ");
    button.title = text;
    if (text !== "") button.append(create("span", "event-cause", text));
    button.addEventListener("click", () => this.seek(event.time_s));
    item.append(button);
    return item;
  }
}

function planText(moment: Moment): string {
  const plan = moment.followed;
  if (plan === null || plan.times_s.length === 0) return "none";
  const since_s = moment.time_s - plan.start_s;
  const length_s = plan.times_s[plan.times_s.length - 1];
  return `${Math.min(Math.max(since_s, 0), length_s).toFixed(1)} of ${length_s.toFixed(1)} s`;
}
