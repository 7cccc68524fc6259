import assert from "node:assert/strict";
import { test } from "node:test";
import type { Sphere } from "../src/messages";
import { Desk, readDeskMessage, Reply } from "../src/spheres/desk";
import { SphereDocument } from "../src/spheres/document";
import { ProtocolError } from "../src/reader";
import { encode } from "./encode";

const kSpheres: Sphere[] = [
  { link: 0, centre_m: [0, 0, 0.1], radius_m: 0.2 },
  { link: 0, centre_m: [0, 0, 0.3], radius_m: 0.2 },
  { link: 2, centre_m: [0.1, 0, 0], radius_m: 0.05 },
];

function loaded(): SphereDocument {
  const document = new SphereDocument();
  document.load(kSpheres);
  return document;
}

test("changes are rounded to tenths of a millimetre, undone and done again", () => {
  const document = loaded();
  document.select(1);
  document.change({ radius_m: 0.12345678 });
  assert.equal(document.selectedSphere?.radius_m, 0.1235);
  document.change({ centre_m: [1 / 3, 0, 0] });
  assert.deepEqual(document.selectedSphere?.centre_m, [0.3333, 0, 0]);
  document.undo();
  document.undo();
  assert.equal(document.spheres, kSpheres);
  assert.equal(document.isChanged, false);
  document.redo();
  assert.equal(document.spheres[1].radius_m, 0.1235);
  assert.equal(document.isChanged, true);
  assert.equal(kSpheres[1].radius_m, 0.2, "what was handed over stays as it was");
});

test("one gesture is one step, and ends with what comes between", () => {
  const document = loaded();
  document.select(0);
  for (const radius_m of [0.21, 0.22, 0.23]) document.change({ radius_m }, "drag");
  document.endGesture();
  document.change({ radius_m: 0.3 }, "drag");
  document.undo();
  assert.equal(document.spheres[0].radius_m, 0.23);
  document.undo();
  assert.equal(document.spheres[0].radius_m, 0.2);
  assert.equal(document.canUndo, false);
});

test("a sphere is added behind those of its link, and the last one is not removed", () => {
  const document = loaded();
  document.add({ link: 0, centre_m: [0, 0, 0], radius_m: 0.1 });
  assert.equal(document.selected, 2);
  document.add({ link: 1, centre_m: [0, 0, 0], radius_m: 0.1 });
  assert.deepEqual(document.spheres.map((one) => one.link), [0, 0, 0, 1, 2]);
  for (let i = 0; i < 10; ++i) {
    document.select(0);
    document.remove();
  }
  assert.equal(document.spheres.length, 1);
});

test("what is saved while something is changed leaves that unsaved", () => {
  const document = loaded();
  document.select(0);
  document.change({ radius_m: 0.5 });
  const sent = document.spheres;
  document.change({ radius_m: 0.6 });
  document.markSaved(sent);
  assert.equal(document.isChanged, true);
  document.undo();
  assert.equal(document.isChanged, false);
});

function reply(request: number): Reply {
  return { kind: "reply", request, cover: null, spheres: null, saved: null, refused: null };
}

test("one request is under way; of those that measure the newest is sent", () => {
  const sent: { request: number; spheres: Sphere[] }[] = [];
  const desk = new Desk((request) => sent.push(request as (typeof sent)[0]), () => {});
  const done: string[] = [];
  for (const name of ["a", "b", "c"]) desk.measure([kSpheres[0]], () => done.push(name));
  desk.fit({ protrusion_m: 0.05 }, kSpheres, () => done.push("fit"));
  assert.equal(sent.length, 1);
  assert.equal(desk.busy, "fit");
  desk.take(reply(1));
  desk.take(reply(2));
  desk.take(reply(3));
  assert.deepEqual(done, ["a", "c", "fit"]);
  assert.deepEqual(sent[2], { request: 3, fit: { protrusion_m: 0.05 }, spheres: kSpheres });
  assert.equal(desk.busy, null);
  assert.throws(() => desk.take(reply(3)), ProtocolError);
});

test("replies are read, and what is none is refused", () => {
  const shares = {
    ...{ spheres: 3, surface_share: 0.5, volume_share: 0.75, gap_m: 0.01, protrusion_m: 0.02 },
    ...{ shapes_m3: 0.1, spheres_m3: 0.2, excess_m3: 0.1 },
  };
  const cover = { links: [{ link: 2, ...shares }], whole: shares };
  const header = { kind: "reply", time_s: 0, request: 4, spheres: kSpheres, cover };
  const read = readDeskMessage(encode(header), 3) as Reply;
  assert.equal(read.request, 4);
  assert.deepEqual(read.spheres, kSpheres);
  assert.equal(read.cover?.links[0].surfaceShare, 0.5);
  assert.equal(read.saved, null);
  assert.throws(() => readDeskMessage(encode(header), 2), ProtocolError);
  assert.throws(() => readDeskMessage(encode({ ...header, cover: { links: [], whole: {} } }), 3), ProtocolError);
  assert.equal(readDeskMessage(encode({ kind: "state" }), 3), null);
});
