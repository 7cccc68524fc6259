// Serves the built page and plays a synthetic run by docs/reference/viewer.md, as fast as it is told.
//
//   node build/tests/fake_server.js [PORT] [room|hall]    by the wall clock, to look at
import { readFile } from "node:fs/promises";
import http from "node:http";
import type { AddressInfo } from "node:net";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { WebSocket, WebSocketServer } from "ws";
import { kDuration_s } from "./synthetic_world";
import { kStep_s, RunOptions, SliceRequest, SyntheticRun } from "./synthetic_run";

const kTypes: Record<string, string> = {
  "/index.html": "text/html; charset=utf-8",
  "/icon.svg": "image/svg+xml",
  "/viewer.js": "text/javascript; charset=utf-8",
  "/viewer.css": "text/css; charset=utf-8",
};

const kDefaults: RunOptions = { place: "room", robot: true, voxels: true, recorded: false };

export class FakeServer {
  /** All that pages have sent. */
  readonly requests: string[] = [];
  time_s = 0;
  private readonly run: SyntheticRun;
  private readonly newest = new Map<string, ArrayBuffer>();
  private readonly told: ArrayBuffer[] = [];
  private welcomed = 0;
  private readonly listeners: (() => void)[] = [];
  private slice: SliceRequest | null = null;
  private step = -1;

  private constructor(
    private readonly http_: http.Server,
    private readonly sockets: WebSocketServer,
    readonly options: RunOptions,
  ) {
    this.run = new SyntheticRun(options);
    sockets.on("connection", (socket) => this.welcome(socket));
  }

  /** On a port that is free, unless one is named. */
  static async start(options: Partial<RunOptions> = {}, token: string | null = null, port = 0): Promise<FakeServer> {
    const folder = process.env["SIDESTEP_VIEWER_DIST"] ?? path.join(path.dirname(fileURLToPath(import.meta.url)), "../../dist");
    const server = http.createServer((request, response) => void answer(folder, request, response));
    const sockets = new WebSocketServer({ noServer: true });
    server.on("upgrade", (request, socket, head) => {
      const url = new URL(request.url ?? "/", "http://localhost");
      if (url.pathname !== "/socket" || url.searchParams.get("token") !== token) {
        socket.end("HTTP/1.1 403 Forbidden\r\n\r\n");
        return;
      }
      sockets.handleUpgrade(request, socket, head, (one) => sockets.emit("connection", one, request));
    });
    await new Promise<void>((done) => server.listen(port, "127.0.0.1", done));
    return new FakeServer(server, sockets, { ...kDefaults, ...options });
  }

  get port(): number {
    return (this.http_.address() as AddressInfo).port;
  }
  get url(): string {
    return `http://127.0.0.1:${this.port}/`;
  }
  get connections(): number {
    return this.sockets.clients.size;
  }

  /** Tells everything up to a time, in steps of kStep_s. */
  tellUntil(time_s: number): void {
    while ((this.step + 1) * kStep_s <= time_s + 1e-9) this.tellStep(++this.step);
  }

  /** Ends all connections without a word, and listens on. */
  drop(): void {
    for (const socket of this.sockets.clients) socket.terminate();
  }

  async close(): Promise<void> {
    this.drop();
    this.sockets.close();
    const closed = new Promise((done) => this.http_.close(done));
    this.http_.closeAllConnections();
    await closed;
  }

  /** Bytes as they are, to everybody. */
  tellRaw(data: ArrayBuffer): void {
    for (const socket of this.sockets.clients) socket.send(data);
  }

  private tellStep(step: number): void {
    const time_s = step * kStep_s;
    this.time_s = time_s;
    if (time_s > kDuration_s + 1) return;
    this.tell("state", this.run.state(time_s));
    this.tell("tracks", this.run.tracks(time_s));
    this.tell("map", this.run.map(time_s, step === 0));
    this.tell("frame", this.run.frame(time_s));
    this.tell("timing", this.run.timing(time_s));
    if (this.slice !== null) this.tell("slice", this.run.slice(time_s, this.slice));
    this.tellPlans(step, time_s);
    if (Math.round(kDuration_s / kStep_s) === step) {
      this.tell("event", this.run.event(time_s, "reached", "goal", "", 0));
      this.tell("end", this.run.end(time_s));
    }
  }

  private tellPlans(step: number, time_s: number): void {
    if (step % 30 !== 0 || time_s >= kDuration_s) return;
    if (step % 60 === 30) {
      this.tell("plan refused", this.run.plan(time_s, "refused", -0.4));
      const cause = "walker comes within 0.31 m of forearm in 1.2 s";
      this.tell("event", this.run.event(time_s, "replan_failed", "moving", cause, 21.5));
      return;
    }
    const detour_m = 1.0 + 0.25 * Math.cos(step);
    this.tell("plan followed", this.run.plan(time_s, "followed", detour_m));
    const [name, cause] = step === 0 ? ["planned", ""] : ["replanned", "walker blocks the base in 0.8 s"];
    this.tell("event", this.run.event(time_s, name, step === 0 ? "goal" : "blocked", cause, 4 + (step % 7)));
  }

  private tell(kind: string, data: ArrayBuffer): void {
    this.newest.set(kind, data);
    if (this.options.recorded) this.told.push(data);
    this.tellRaw(data);
  }

  /** Until so many have connected since the start. */
  async untilWelcomed(count: number): Promise<void> {
    while (this.welcomed < count) await new Promise<void>((done) => this.sockets.once("connection", () => done()));
  }

  private welcome(socket: WebSocket): void {
    ++this.welcomed;
    socket.on("message", (data, isBinary) => this.hear(socket, String(data), isBinary));
    socket.on("error", () => socket.terminate());
    socket.send(this.run.world(this.options.recorded ? 0 : Math.max(0, this.time_s)));
    if (this.options.recorded) {
      for (const data of this.told) socket.send(data);
      return;
    }
    if (this.step >= 0) socket.send(this.run.map(this.time_s, true));
    for (const [kind, data] of this.newest) if (kind !== "map") socket.send(data);
  }

  /** Until the last that a page has sent is of this kind. */
  async heard(pattern: RegExp): Promise<string> {
    for (;;) {
      const last = this.requests[this.requests.length - 1] ?? "";
      if (pattern.test(last)) return last;
      await this.hearNext();
    }
  }

  /** Until a page sends something more. */
  hearNext(): Promise<void> {
    return new Promise((done) => this.listeners.push(done));
  }

  private hear(socket: WebSocket, text: string, isBinary: boolean): void {
    this.requests.push(text);
    for (const listener of this.listeners.splice(0)) listener();
    const known = !isBinary && text.length <= 256 && /^\{"slice":/.test(text);
    if (!known) return socket.terminate();
    this.slice = (JSON.parse(text) as { slice: SliceRequest | null }).slice;
  }
}

async function answer(folder: string, request: http.IncomingMessage, response: http.ServerResponse): Promise<void> {
  const { pathname } = new URL(request.url ?? "/", "http://localhost");
  const name = pathname === "/" ? "/index.html" : pathname;
  const type = kTypes[name];
  if (type === undefined) {
    response.writeHead(404).end();
    return;
  }
  const data = await readFile(path.join(folder, name));
  response.writeHead(200, {
    "Content-Type": type,
    "Content-Security-Policy": "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
  });
  response.end(data);
}

async function main(): Promise<void> {
  const place = process.argv[3] === "hall" ? "hall" : "room";
  const server = await FakeServer.start({ place }, null, Number(process.argv[2] ?? 8765));
  console.log(`Look at ${server.url}`);
  const begun_ms = Date.now();
  setInterval(() => server.tellUntil((Date.now() - begun_ms) / 1000), 1000 * kStep_s);
}

if (path.basename(process.argv[1] ?? "") === "fake_server.js") await main();
