import { bindings } from "./bindings";
import { Connection, ConnectionState, socketUrl } from "./connection";
import { DepthImage } from "./depth_image";
import { byId, chooseButton, create, setText } from "./dom";
import type { History, Moment } from "./history";
import { Keyboard } from "./keyboard";
import { Panel } from "./panel";
import { Playback } from "./playback";
import { ProtocolError } from "./protocol";
import { Stage } from "./scene/stage";
import type { ViewMode } from "./scene/views";
import { Session } from "./session";
import { followTheme, kOverlays, overlayShown, rememberOverlay } from "./settings";
import { SliceControl } from "./slice_control";
import { showFault, showNoScene, showStatus } from "./status";
import { Timeline } from "./timeline";
import { Transport } from "./transport";

const kPanel_ms = 100;
const kTimeline_ms = 200;

export class App {
  readonly playback = new Playback();
  readonly switchTheme: () => void;
  readonly slice = new SliceControl((request) => this.connection.send(request));
  private readonly session = new Session((history) => this.begin(history));
  private readonly connection: Connection;
  private readonly stage: Stage | null;
  private readonly panel = new Panel(
    (id, shown) => this.setOverlay(id, shown),
    (time_s) => this.seek(time_s),
  );
  private readonly depth = new DepthImage();
  private readonly timeline: Timeline;
  private readonly transport: Transport;
  private readonly overlays = new Map<string, boolean>();
  private connected: ConnectionState = "connecting";
  private retryAt_ms = 0;
  private heard_ms = 0;
  private moment: Moment | null = null;
  /** Something came in since the last frame of the screen. */
  private news = false;
  private frame_ms = 0;
  private panel_ms = 0;
  private timeline_ms = 0;
  private faults = 0;
  private firstFault = "";

  constructor() {
    this.switchTheme = followTheme(byId("theme"), () => this.recolour());
    this.timeline = new Timeline(byId("timeline"), (time_s) => this.seek(time_s));
    this.transport = new Transport(this.playback, () => this.refresh());
    this.stage = this.makeStage();
    this.connection = new Connection(socketUrl(window.location), {
      message: (data) => this.take(data),
      changed: (state, retry_s) => this.connectionChanged(state, retry_s),
    });
    new Keyboard(bindings(this));
    this.listen();
    for (const overlay of kOverlays) this.setOverlay(overlay.id, overlayShown(overlay));
    this.lookAhead();
  }

  start(): void {
    this.connection.open();
    this.stage?.recolour();
    const frame = (now_ms: number) => {
      this.frame(now_ms);
      window.requestAnimationFrame(frame);
    };
    window.requestAnimationFrame(frame);
  }

  toggleOverlay(id: string): void {
    this.setOverlay(id, !this.overlays.get(id));
  }

  choose(view: ViewMode): void {
    if (view === "free") this.stage?.views.reset();
    else this.stage?.views.choose(view);
    this.stage?.invalidate();
    chooseButton(document.querySelectorAll<HTMLElement>("[data-view]"), (one) => one.dataset["view"] === view);
  }

  /** By so much farther than now. */
  lookAhead(farther_s = 0): void {
    const slider = byId<HTMLInputElement>("ahead");
    slider.value = String(Number(slider.value) + farther_s);
    const ahead_s = Number(slider.value);
    setText(byId("ahead-value"), ahead_s === 0 ? "now" : `${ahead_s.toFixed(1)} s`);
    this.stage?.lookAhead(ahead_s);
    this.slice.lookAhead(ahead_s);
  }

  seek(time_s: number): void {
    this.playback.seek(time_s);
    this.refresh();
  }

  /** What is shown may have changed: look again at the next frame. */
  refresh(): void {
    this.news = true;
  }

  private makeStage(): Stage | null {
    const elements = {
      canvas: byId<HTMLCanvasElement>("scene"),
      clearanceLabel: byId("clearance-label"),
    };
    try {
      const stage = new Stage(elements);
      this.slice.placed = (...where) => stage.handle.place(...where);
      stage.handle.dragged = (position_m) => this.slice.move(position_m);
      return stage;
    } catch {
      showNoScene("WebGL is turned off, or there is none.");
      return null;
    }
  }

  private listen(): void {
    byId("retry").addEventListener("click", () => this.connection.open());
    for (const button of document.querySelectorAll<HTMLElement>("[data-view]")) {
      button.addEventListener("click", () => this.choose(button.dataset["view"] as ViewMode));
    }
    const cut = byId<HTMLInputElement>("cut");
    cut.addEventListener("input", () => this.applyCut());
    byId("ahead").addEventListener("input", () => this.lookAhead());
    const episode = byId<HTMLSelectElement>("episode");
    episode.addEventListener("change", () => this.session.choose(episode.selectedIndex));
  }

  private recolour(): void {
    this.stage?.recolour();
    this.timeline.rebuild();
    this.timeline_ms = 0;
    this.refresh();
  }

  private setOverlay(id: string, shown: boolean): void {
    if (this.overlays.has(id)) rememberOverlay(id, shown);
    this.overlays.set(id, shown);
    this.panel.check(id, shown);
    this.stage?.toggle(id, shown);
    if (id === "slice") this.slice.toggle(shown);
    if (id === "camera") byId("depth").classList.toggle("off", !shown);
    this.refresh();
  }

  private take(data: ArrayBuffer): void {
    this.heard_ms = performance.now();
    try {
      this.session.take(data);
    } catch (error) {
      if (!(error instanceof ProtocolError)) throw error;
      this.firstFault ||= error.message;
      const count = ++this.faults === 1 ? "A message" : `${this.faults} messages`;
      showFault(`${count} could not be read, the first since ${this.firstFault}.`);
    }
    this.refresh();
  }

  private connectionChanged(state: ConnectionState, retry_s: number): void {
    this.connected = state;
    this.retryAt_ms = performance.now() + 1000 * retry_s;
    document.documentElement.dataset["connection"] = state;
    if (state === "open") {
      this.heard_ms = performance.now();
      this.connection.send(this.slice.request());
    }
    this.refresh();
  }

  private begin(history: History): void {
    this.playback.attach(history);
    this.panel.begin(history.world);
    this.stage?.begin(history.world);
    for (const [id, shown] of this.overlays) this.stage?.toggle(id, shown);
    setText(byId("run-title"), history.world.title);
    document.title = `${history.world.title} – Sidestep`;
    this.timeline_ms = 0;
    this.listEpisodes();
  }

  private listEpisodes(): void {
    const { episodes } = this.session;
    byId("episode-choice").hidden = episodes.length < 2;
    const select = byId<HTMLSelectElement>("episode");
    if (select.options.length === episodes.length) return;
    select.replaceChildren(...episodes.map((one) => create("option", "", String(one.world.episode))));
    select.selectedIndex = Math.max(0, episodes.indexOf(this.session.history as History));
  }

  private frame(now_ms: number): void {
    const elapsed_s = Math.min(0.25, (now_ms - this.frame_ms) / 1000);
    this.frame_ms = now_ms;
    const history = this.session.history;
    if (history !== null) {
      const before_s = this.playback.time_s;
      this.playback.tick(elapsed_s);
      if (this.news || this.playback.time_s !== before_s) this.showMoment(history);
      this.showSlowly(history, now_ms);
    }
    if (now_ms - this.panel_ms > kPanel_ms) this.showStanding(now_ms);
    this.stage?.frame();
  }

  private showMoment(history: History): void {
    this.news = false;
    this.moment = history.at(this.playback.time_s);
    this.stage?.show(this.moment, history);
    this.depth.show(this.moment.frame);
    this.timeline.showTime(this.moment.time_s);
    this.transport.show(history);
    if (this.stage !== null) {
      this.slice.setGrid(this.stage.grid);
      this.fitCut();
    }
  }

  /** What need not change with every frame. */
  private showSlowly(history: History, now_ms: number): void {
    if (this.moment === null) return;
    if (now_ms - this.panel_ms > kPanel_ms) {
      this.panel.show(this.moment, history);
      this.slice.show(this.moment, history, this.playback.mode === "live");
      this.listEpisodes();
    }
    if (now_ms - this.timeline_ms > kTimeline_ms) {
      this.timeline_ms = now_ms;
      this.timeline.update(history);
      this.timeline.showTime(this.moment.time_s);
    }
  }

  private showStanding(now_ms: number): void {
    this.panel_ms = now_ms;
    showStatus({
      connection: this.connected,
      retry_s: (this.retryAt_ms - now_ms) / 1000,
      quiet_s: (now_ms - this.heard_ms) / 1000,
      history: this.session.history,
      moment: this.moment,
    });
  }

  private fitCut(): void {
    const grid = this.stage?.grid ?? null;
    const cut = byId<HTMLInputElement>("cut");
    if (grid === null) return;
    const top_m = grid.origin_m[2] + grid.voxel_m * grid.size_vox[2];
    if (Number(cut.max) === top_m) return;
    const whole = Number(cut.value) === Number(cut.max);
    Object.assign(cut, { min: String(grid.origin_m[2]), max: String(top_m), step: "any" });
    if (whole) cut.value = String(top_m);
    this.applyCut();
  }

  private applyCut(): void {
    const cut = byId<HTMLInputElement>("cut");
    const whole = Number(cut.value) >= Number(cut.max);
    this.stage?.cutAbove(whole ? 1e9 : Number(cut.value));
    setText(byId("cut-value"), whole ? "nothing" : `${Number(cut.value).toFixed(2)} m`);
  }
}
