// What the sphere editor asks Sidestep, and what it is answered (docs/reference/sphere_editor.md).
import type { Sphere } from "../messages";
import { readHeader, readSpheres } from "../protocol";
import { ProtocolError, Reader } from "../reader";

export interface Cover {
  spheres: number;
  surfaceShare: number;
  volumeShare: number;
  gap_m: number;
  protrusion_m: number;
  shapes_m3: number;
  excess_m3: number;
}

export interface RobotCover {
  links: (Cover & { link: number })[];
  whole: Cover;
}

/** Which file is edited. */
export interface Profile {
  kind: "profile";
  file: string;
  revision: string;
  cover: RobotCover;
}

export interface Reply {
  kind: "reply";
  request: number;
  cover: RobotCover | null;
  /** That were fitted. */
  spheres: Sphere[] | null;
  /** The revision that was saved. */
  saved: string | null;
  /** Why nothing was. */
  refused: string | null;
}

export type FitGoal = ({ protrusion_m: number } | { count: number }) & { link?: number };

/** Null for a message of another kind. */
export function readDeskMessage(data: ArrayBuffer, links: number): Profile | Reply | null {
  const { header } = readHeader(data);
  const kind = header.text("kind");
  if (kind === "profile") {
    const cover = readCover(header.child("cover"), links);
    return { kind, file: header.text("file"), revision: header.text("revision"), cover };
  }
  if (kind !== "reply") return null;
  const textOrNull = (key: string) => (header.isNull(key) ? null : header.text(key));
  return {
    kind,
    request: header.number("request"),
    cover: header.isNull("cover") ? null : readCover(header.child("cover"), links),
    spheres: header.isNull("spheres") ? null : readSpheres(header, links),
    saved: textOrNull("saved"),
    refused: textOrNull("refused"),
  };
}

function readCover(cover: Reader, links: number): RobotCover {
  return {
    links: cover.list("links", (value, where) => {
      const link = Reader.of(value, where);
      return { link: link.index("link", links), ...readShares(link) };
    }),
    whole: readShares(cover.child("whole")),
  };
}

function readShares(cover: Reader): Cover {
  return {
    spheres: cover.number("spheres"),
    surfaceShare: cover.number("surface_share"),
    volumeShare: cover.number("volume_share"),
    gap_m: cover.number("gap_m"),
    protrusion_m: cover.number("protrusion_m"),
    shapes_m3: cover.number("shapes_m3"),
    excess_m3: cover.number("excess_m3"),
  };
}

type Task = { kind: "measure" | "fit" | "save"; ask: object; spheres: readonly Sphere[]; done: (reply: Reply) => void };

/** One request after the other; of those that measure, the newest is enough. */
export class Desk {
  private waiting: Task[] = [];
  private underway: { request: number; task: Task } | null = null;
  private last = 0;

  constructor(
    private readonly send: (request: object) => void,
    private readonly changed: () => void,
  ) {}

  /** What is being done that takes its time. */
  get busy(): "fit" | "save" | null {
    const kinds = [this.underway?.task, ...this.waiting].map((task) => task?.kind);
    return kinds.includes("save") ? "save" : kinds.includes("fit") ? "fit" : null;
  }

  measure(spheres: readonly Sphere[], done: (reply: Reply) => void): void {
    this.waiting = this.waiting.filter((task) => task.kind !== "measure");
    this.add({ kind: "measure", ask: {}, spheres, done });
  }

  fit(goal: FitGoal, spheres: readonly Sphere[], done: (reply: Reply) => void): void {
    this.add({ kind: "fit", ask: { fit: goal }, spheres, done });
  }

  save(revision: string, spheres: readonly Sphere[], done: (reply: Reply) => void): void {
    this.add({ kind: "save", ask: { save: revision }, spheres, done });
  }

  take(reply: Reply): void {
    if (this.underway === null || this.underway.request !== reply.request) {
      throw new ProtocolError(`nobody has asked for reply ${reply.request}`);
    }
    const { task } = this.underway;
    this.underway = null;
    task.done(reply);
    this.next();
  }

  /** What was asked is not answered any more. */
  reset(): void {
    this.underway = null;
    this.waiting = [];
    this.changed();
  }

  private add(task: Task): void {
    this.waiting.push(task);
    this.next();
  }

  private next(): void {
    const task = this.underway === null ? this.waiting.shift() : undefined;
    if (task !== undefined) {
      const request = ++this.last;
      this.underway = { request, task };
      this.send({ request, ...task.ask, spheres: task.spheres });
    }
    this.changed();
  }
}
