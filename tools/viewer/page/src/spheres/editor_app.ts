// Puts the sphere editor together: what Sidestep tells, what is changed, and what shows it.
import { Connection, ConnectionState, socketUrl } from "../connection";
import { byId, chooseButton, setText } from "../dom";
import { Keyboard } from "../keyboard";
import type { History } from "../history";
import type { Sphere } from "../messages";
import { ProtocolError } from "../protocol";
import { Session } from "../session";
import { followTheme } from "../settings";
import { editorBindings } from "./editor_bindings";
import { EditorPanel } from "./editor_panel";
import { EditorStage, Tool } from "./editor_stage";
import { Desk, FitGoal, Profile, readDeskMessage, Reply } from "./desk";
import { SphereDocument } from "./document";

export class EditorApp {
  readonly document = new SphereDocument();
  readonly switchTheme: () => void;
  readonly stage: EditorStage | null;
  private readonly session = new Session(() => {});
  private readonly connection: Connection;
  private readonly desk: Desk;
  private readonly panel: EditorPanel;
  private profile: Profile | null = null;
  private history: History | null = null;
  private link: number | null = null;
  private connected: ConnectionState = "connecting";
  private shown: readonly Sphere[] = [];

  constructor() {
    this.switchTheme = followTheme(byId("theme"), () => this.stage?.recolour());
    this.stage = this.makeStage();
    this.panel = new EditorPanel({
      select: (index) => this.document.select(index),
      chooseLink: (link) => this.chooseLink(link),
      change: (change, gesture) => this.document.change(change, gesture),
      endGesture: () => this.document.endGesture(),
    });
    this.connection = new Connection(socketUrl(window.location), {
      message: (data) => this.take(data),
      changed: (state) => this.connectionChanged(state),
    });
    this.desk = new Desk((request) => this.connection.send(request), () => this.showStanding());
    this.document.changed = () => this.showDocument();
    new Keyboard(editorBindings(this));
    this.listen();
  }

  start(): void {
    this.stage?.recolour();
    this.connection.open();
    const frame = () => {
      this.stage?.frame();
      window.requestAnimationFrame(frame);
    };
    window.requestAnimationFrame(frame);
  }

  chooseTool(tool: Tool): void {
    this.stage?.choose(tool);
    chooseButton(document.querySelectorAll<HTMLElement>("[data-tool]"), (one) => one.dataset["tool"] === tool);
  }

  chooseLink(link: number | null): void {
    this.link = link;
    const sphere = this.document.selectedSphere;
    if (link !== null && sphere !== null && sphere.link !== link) this.document.select(null);
    this.showDocument();
  }

  /** On the link that is chosen, or of the selected sphere, beside what is there. */
  add(): void {
    const near = this.document.selectedSphere;
    const link = this.link ?? near?.link ?? this.shapes[0]?.link ?? 0;
    const shape = this.shapes.find((one) => one.link === link);
    const centre_m = (near ?? { centre_m: (shape?.pose.slice(0, 3) ?? [0, 0, 0]) as Sphere["centre_m"] }).centre_m;
    this.document.add({ link, centre_m, radius_m: near?.radius_m ?? 0.05 });
  }

  /** Along an axis of the link's frame. */
  nudge(axis: number, by_m: number): void {
    const sphere = this.document.selectedSphere;
    if (sphere === null) return;
    const centre_m = sphere.centre_m.map((value, i) => (i === axis ? value + by_m : value)) as Sphere["centre_m"];
    this.document.change({ centre_m }, `nudge ${axis}`);
  }

  grow(by_m: number): void {
    const sphere = this.document.selectedSphere;
    if (sphere !== null) this.document.change({ radius_m: sphere.radius_m + by_m }, "grow");
  }

  step(by: 1 | -1): void {
    const { spheres, selected } = this.document;
    const own = [...spheres.keys()].filter((i) => this.link === null || spheres[i].link === this.link);
    if (own.length === 0) return;
    const at = own.indexOf(selected ?? -1);
    this.document.select(own[(at + by + own.length) % own.length]);
  }

  fit(): void {
    if (this.profile === null) return;
    const value = Number(byId<HTMLInputElement>("fit-value").value);
    const kind = byId<HTMLSelectElement>("fit-kind").value;
    const goal = (kind === "count" ? { count: Math.round(value) } : { protrusion_m: value / 1000 }) as FitGoal;
    const isFine = kind === "count" ? value >= 1 && value <= 1000 : value >= 2 && value <= 1000;
    if (!isFine) return this.say(`Between ${kind === "count" ? "1 and 1000 spheres" : "2 and 1000 mm"}, please.`, "warn");
    if (this.link !== null) goal.link = this.link;
    this.say("");
    this.desk.fit(goal, this.document.spheres, (reply) => {
      if (reply.spheres !== null) this.document.replace(reply.spheres);
    });
  }

  save(): void {
    if (this.profile === null || this.desk.busy !== null) return;
    const { spheres } = this.document;
    this.desk.save(this.profile.revision, spheres, (reply) => this.wasSaved(reply, spheres));
  }

  private get shapes() {
    return this.history?.world.shapes ?? [];
  }

  private wasSaved(reply: Reply, spheres: readonly Sphere[]): void {
    if (reply.saved === null) return this.say(`Not saved: ${reply.refused ?? "nobody says why"}`, "bad");
    if (this.profile !== null) this.profile = { ...this.profile, revision: reply.saved };
    this.document.markSaved(spheres);
    this.say("Saved.", "good");
  }

  private makeStage(): EditorStage | null {
    try {
      const stage = new EditorStage(byId<HTMLCanvasElement>("scene"));
      stage.picked = (index) => this.document.select(index);
      stage.moved = (centre_m) => this.document.change({ centre_m }, "drag");
      stage.resized = (radius_m) => this.document.change({ radius_m }, "drag");
      stage.released = () => this.document.endGesture();
      return stage;
    } catch {
      this.say("This browser does not draw in three dimensions; the figures work without.", "warn");
      return null;
    }
  }

  private listen(): void {
    const on = (id: string, act: () => void) => byId(id).addEventListener("click", act);
    on("retry", () => this.connection.open());
    on("undo", () => this.document.undo());
    on("redo", () => this.document.redo());
    on("add", () => this.add());
    on("remove", () => this.document.remove());
    on("fit", () => this.fit());
    on("save", () => this.save());
    for (const button of document.querySelectorAll<HTMLElement>("[data-tool]")) {
      button.addEventListener("click", () => this.chooseTool(button.dataset["tool"] as Tool));
    }
    const list = byId<HTMLSelectElement>("sphere-list");
    list.addEventListener("change", () => this.document.select(list.value === "" ? null : Number(list.value)));
    const kind = byId<HTMLSelectElement>("fit-kind");
    kind.addEventListener("change", () => this.fitKindChanged(kind.value));
    const shapes = byId<HTMLInputElement>("show-shapes");
    shapes.addEventListener("change", () => this.stage?.showShapes(shapes.checked));
    window.addEventListener("beforeunload", (event) => {
      if (this.document.isChanged) event.preventDefault();
    });
  }

  private fitKindChanged(kind: string): void {
    const count = Math.max(1, this.document.spheres.filter((one) => this.link === null || one.link === this.link).length);
    byId<HTMLInputElement>("fit-value").value = kind === "count" ? String(count) : "40";
    setText(byId("fit-unit"), kind === "count" ? "spheres" : "mm");
  }

  private take(data: ArrayBuffer): void {
    try {
      const message = readDeskMessage(data, this.session.history?.world.links.length ?? 0);
      if (message === null) this.session.take(data);
      else if (message.kind === "profile") this.begin(message);
      else this.desk.take(message);
      if (message?.kind === "reply" && message.cover !== null) this.panel.showCover(message.cover);
    } catch (error) {
      if (!(error instanceof ProtocolError)) throw error;
      this.say(`A message could not be read: ${error.message}.`, "bad");
    }
  }

  /** World and state have come before. What was changed and not saved stays, after a lost connection. */
  private begin(profile: Profile): void {
    const history = this.session.history;
    if (history === null) throw new ProtocolError("profile came before any world");
    const isKept = this.profile !== null && this.document.isChanged;
    const isSame = this.profile?.revision === profile.revision;
    if (!isKept) this.profile = profile;
    else if (!isSame) this.say("The profile was changed meanwhile: what is here cannot be saved over it.", "bad");
    setText(byId("run-title"), `${history.world.robot}: ${profile.file.split("/").slice(-2).join("/")}`);
    byId("run-title").title = profile.file;
    document.title = `${history.world.robot} – spheres – Sidestep`;
    if (isKept) return this.showDocument();
    this.history = history;
    this.stage?.begin(history.at(history.last_s), history);
    this.panel.begin(history.world);
    this.panel.showCover(profile.cover);
    this.shown = history.world.spheres;
    this.document.load(history.world.spheres);
  }

  private connectionChanged(state: ConnectionState): void {
    this.connected = state;
    document.documentElement.dataset["connection"] = state;
    if (state !== "open") this.desk.reset();
    byId("retry").hidden = state !== "lost";
    this.showStanding();
  }

  private showDocument(): void {
    const { spheres, selected } = this.document;
    this.stage?.show(spheres, selected);
    this.panel.show(spheres, selected, this.link);
    if (spheres !== this.shown && this.profile !== null) {
      this.shown = spheres;
      this.desk.measure(spheres, () => {});
    }
    this.showStanding();
  }

  private showStanding(): void {
    const [text, tone] = this.standing();
    const pill = byId("run-status");
    setText(pill, text);
    pill.dataset["tone"] = tone;
    const { document: edited, desk } = this;
    const isReady = this.connected === "open" && this.profile !== null;
    const enable = (id: string, isEnabled: boolean) => {
      byId<HTMLButtonElement>(id).disabled = !isEnabled;
    };
    enable("save", isReady && edited.isChanged && desk.busy === null);
    enable("fit", isReady && desk.busy === null);
    enable("undo", edited.canUndo);
    enable("redo", edited.canRedo);
    enable("add", this.profile !== null);
    enable("remove", edited.selected !== null && edited.spheres.length > 1);
    setText(byId("fit"), this.link === null ? "Fit all links" : "Fit this link");
  }

  private standing(): [string, string] {
    if (this.connected === "lost") return [this.profile === null ? "Nobody answers" : "Connection lost", "bad"];
    if (this.profile === null || this.connected === "connecting") return ["Connecting", "idle"];
    if (this.desk?.busy === "fit") return ["Fitting", "busy"];
    if (this.desk?.busy === "save") return ["Saving", "busy"];
    return this.document.isChanged ? ["Changed, not saved", "warn"] : ["As in the file", "good"];
  }

  private say(text: string, tone = ""): void {
    const note = byId("scene-note");
    note.hidden = text === "";
    note.dataset["tone"] = tone;
    setText(note, text);
  }
}
