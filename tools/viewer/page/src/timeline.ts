// Mapping, checking, planning and events over time, each with its p50 and p95.
import uPlot from "uplot";
import { create, setText } from "./dom";
import type { History } from "./history";
import { percentile } from "./statistics";

const kAxisWidth_px = 40;

interface Row {
  id: string;
  label: string;
  hint: string;
  /** The colour's name in the style sheet. */
  colour: string;
  points: boolean;
  /** Times and milliseconds of what lies in a span of time. */
  values(history: History, from_s: number, to_s: number): [number[], number[]];
}

function within<T extends { time_s: number }>(items: readonly T[], from_s: number, to_s: number): T[] {
  return items.filter((item) => item.time_s >= from_s && item.time_s <= to_s);
}

const kRows: readonly Row[] = [
  {
    ...{ id: "mapping", label: "Mapping", colour: "series-mapping", points: false },
    hint: "Integrating a frame and updating the field, ms",
    values(history, from_s, to_s) {
      const frames = within(history.frameTimings.items, from_s, to_s);
      return [frames.map((one) => one.time_s), frames.map((one) => one.integrate_ms + one.field_ms)];
    },
  },
  {
    ...{ id: "checking", label: "Checking", colour: "series-checking", points: false },
    hint: "The longest step of the planning side in each tenth of a second, ms",
    values(history, from_s, to_s) {
      const steps = within(history.stepTimings.items, from_s, to_s);
      return [steps.map((one) => one.time_s), steps.map((one) => one.step_ms)];
    },
  },
  {
    ...{ id: "planning", label: "Planning", colour: "series-planning", points: true },
    hint: "All attempts that led to a new trajectory, ms",
    values(history, from_s, to_s) {
      const plans = within(history.events.items, from_s, to_s).filter((one) => (one.solve_ms ?? 0) > 0);
      return [plans.map((one) => one.time_s), plans.map((one) => one.solve_ms as number)];
    },
  },
];

interface Chart {
  row: Row;
  plot: uPlot;
  medians: HTMLElement;
}

export class Timeline {
  private charts: Chart[] = [];
  private readonly marks = create("canvas", "event-marks");
  private readonly playhead = create("div", "playhead");
  private span: [number, number] = [0, 1];
  /** What the charts show, in short. */
  private drawn = "";

  /** `seek` is called when a moment is pointed at. */
  constructor(
    private readonly root: HTMLElement,
    private readonly seek: (time_s: number) => void,
  ) {
    this.playhead.setAttribute("aria-hidden", "true");
    this.build();
    new ResizeObserver(() => this.resize()).observe(root);
    root.addEventListener("pointerdown", (event) => this.point(event));
    root.addEventListener("pointermove", (event) => {
      if (event.buttons === 1) this.point(event);
    });
  }

  /** Draws all anew, as after a change of colours. */
  rebuild(): void {
    for (const chart of this.charts) chart.plot.destroy();
    this.charts = [];
    this.drawn = "";
    this.root.replaceChildren();
    this.build();
  }

  /** Does nothing where nothing is new. */
  update(history: History): void {
    const { frameTimings, stepTimings, events, last_s } = history;
    const told = [frameTimings, stepTimings, events].map((track) => track.items.length);
    const drawn = [history.world.identity, last_s, ...told].join();
    if (drawn === this.drawn) return;
    this.drawn = drawn;
    const from_s = history.first_s;
    const to_s = Math.max(history.last_s, from_s + 1);
    this.span = [from_s, to_s];
    for (const { row, plot, medians } of this.charts) {
      const [times, values] = row.values(history, from_s, to_s);
      plot.setData([times, values], false);
      const most = values.reduce((one, other) => Math.max(one, other), 0.01) * 1.15;
      plot.batch(() => {
        plot.setScale("x", { min: from_s, max: to_s });
        plot.setScale("y", { min: 0, max: most });
      });
      setText(medians, `${inMs(percentile(values, 0.5))} / ${inMs(percentile(values, 0.95))}`);
    }
    this.drawMarks(history);
  }

  showTime(time_s: number): void {
    const [from_s, to_s] = this.span;
    const share = Math.min(1, Math.max(0, (time_s - from_s) / (to_s - from_s)));
    const { left, width } = this.plotArea();
    this.playhead.style.transform = `translateX(${(left + share * width).toFixed(1)}px)`;
  }

  private build(): void {
    const events = create("div", "track events-track");
    const label = create("div", "track-label");
    label.append(create("span", "track-name", "Events"), create("span", "track-medians", "p50 / p95 ms"));
    events.append(label, this.marks);
    this.root.append(events);
    kRows.forEach((row, i) => this.charts.push(this.chart(row, i === kRows.length - 1)));
    this.root.append(this.playhead);
    this.resize();
  }

  private chart(row: Row, isLast: boolean): Chart {
    const track = create("div", "track");
    track.title = row.hint;
    const label = create("div", "track-label");
    const name = create("span", "track-name", row.label);
    name.dataset["series"] = row.id;
    const medians = create("span", "track-medians", "– / –");
    medians.id = `medians-${row.id}`;
    label.append(name, medians);
    const room = create("div", "track-plot");
    track.append(label, room);
    this.root.append(track);
    return { row, medians, plot: new uPlot(plotOptions(row, isLast), [[], []], room) };
  }

  private resize(): void {
    for (const { plot } of this.charts) {
      const room = plot.root.parentElement as HTMLElement;
      plot.setSize({ width: Math.max(80, room.clientWidth), height: Math.max(30, room.clientHeight) });
    }
    const ratio = window.devicePixelRatio;
    this.marks.width = Math.max(1, Math.round(this.marks.clientWidth * ratio));
    this.marks.height = Math.max(1, Math.round(this.marks.clientHeight * ratio));
    this.drawn = "";
  }

  /** In the root's pixels: where the plots lie. */
  private plotArea(): { left: number; width: number } {
    const over = this.charts[0].plot.over.getBoundingClientRect();
    return { left: over.left - this.root.getBoundingClientRect().left, width: over.width };
  }

  private point(event: PointerEvent): void {
    const { left, width } = this.plotArea();
    const share = (event.clientX - this.root.getBoundingClientRect().left - left) / width;
    if (share < -0.01 || share > 1.01) return;
    this.seek(this.span[0] + share * (this.span[1] - this.span[0]));
  }

  private drawMarks(history: History): void {
    const context = this.marks.getContext("2d");
    if (context === null) return;
    const style = getComputedStyle(document.documentElement);
    const { width, height } = this.marks;
    const ratio = window.devicePixelRatio;
    const from_px = kAxisWidth_px * ratio;
    context.clearRect(0, 0, width, height);
    for (const event of history.events.items) {
      const share = (event.time_s - this.span[0]) / (this.span[1] - this.span[0]);
      context.fillStyle = style.getPropertyValue(`--event-${event.event}`).trim() || style.getPropertyValue("--muted");
      context.fillRect(from_px + share * (width - from_px) - ratio, 0, 2 * ratio, height);
    }
  }
}

function inMs(value: number | null): string {
  if (value === null) return "–";
  return value >= 100 ? value.toFixed(0) : value >= 1 ? value.toFixed(1) : value.toFixed(2);
}

function plotOptions(row: Row, isLast: boolean): uPlot.Options {
  const style = getComputedStyle(document.documentElement);
  const colour = style.getPropertyValue(`--${row.colour}`).trim();
  const faint = style.getPropertyValue("--line").trim();
  const ink = style.getPropertyValue("--muted").trim();
  const font = `10px ${style.getPropertyValue("--font").trim()}`;
  const axis: uPlot.Axis = { stroke: ink, font, ticks: { show: false }, grid: { stroke: faint, width: 1 } };
  return {
    width: 300,
    height: isLast ? 62 : 46,
    padding: [5, 0, isLast ? 0 : 5, 0],
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false, auto: false }, y: { auto: false } },
    axes: [
      { ...axis, show: true, size: isLast ? 16 : 0, gap: 2, values: isLast ? (_, all) => all.map((t) => `${t} s`) : () => [] },
      { ...axis, size: kAxisWidth_px, gap: 4, space: 13, values: (_, all) => all.map((value) => String(value)) },
    ],
    series: [
      {},
      {
        stroke: colour,
        width: row.points ? 0 : 1.2,
        fill: row.points ? undefined : `color-mix(in srgb, ${colour} 18%, transparent)`,
        points: { show: row.points, size: 5, fill: colour, stroke: colour },
      } as uPlot.Series,
    ],
  };
}
