// How the page behaves when all is not well, and for whoever uses it, in headless Chromium.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import type { Browser } from "playwright-core";
import { kWait_ms, openBrowser, openPage, waitForText } from "./browser";
import { encode } from "./encode";
import { FakeServer } from "./fake_server";
import { kDuration_s } from "./synthetic_world";

let browser: Browser;
before(async () => {
  browser = await openBrowser();
});
after(() => browser.close());

const kLong = { timeout: 3 * kWait_ms };

test("the page loads under a strict policy, from its own host alone, and passes its token on", kLong, async () => {
  const server = await FakeServer.start({}, "s3cret");
  server.tellUntil(1);
  const context = await browser.newContext();
  const page = await context.newPage();
  const asked: string[] = [];
  const complaints: string[] = [];
  page.on("request", (request) => asked.push(request.url()));
  page.on("console", (message) => message.type() === "error" && complaints.push(message.text()));
  await page.goto(`${server.url}?token=s3cret`);
  await waitForText(page, "#run-title", /^Synthetic room$/);
  await waitForText(page, "#run-status", /^Moving$/);
  assert.ok(asked.length >= 3);
  assert.deepEqual(asked.filter((url) => !url.startsWith(server.url)), []);
  assert.deepEqual(complaints, []);
  await context.close();
  await server.close();
});

test("without the token nobody answers, and the page says so", kLong, async () => {
  const server = await FakeServer.start({}, "s3cret");
  const { page } = await openPage(browser, server.url);
  await waitForText(page, "#card-title", /^No run answers$/);
  assert.equal(server.connections, 0);
  await page.context().close();
  await server.close();
});

test("a dropped connection recovers; what was kept stays", kLong, async () => {
  const server = await FakeServer.start();
  server.tellUntil(0);
  const { page } = await openPage(browser, server.url);
  await waitForText(page, "#clock", /^0\.00 s/);
  server.tellUntil(5);
  await waitForText(page, "#clock", /^5\.00 s/);
  const waitForEvents = (count: number) =>
    page.waitForFunction((wanted) => document.querySelectorAll("#events li").length === wanted, count);
  await waitForEvents(2);
  server.drop();
  await server.untilWelcomed(2);
  server.tellUntil(6);
  await waitForText(page, "#clock", /^6\.00 s/);
  // The newest event, told again to whoever connects, is not listed twice.
  await waitForEvents(3);
  assert.equal(await page.locator("#scrub").getAttribute("min"), "0");
  await page.context().close();
  await server.close();
});

test("a run that goes away is told of, and found again when it is back", kLong, async () => {
  const server = await FakeServer.start();
  server.tellUntil(2);
  const { port } = server;
  const { page } = await openPage(browser, server.url);
  await waitForText(page, "#clock", /^2\.00 s/);
  await server.close();
  await waitForText(page, "#run-status", /^Connection lost$/);
  await waitForText(page, "#retry", /^Try now \(\d s\)$/);
  await waitForText(page, "#clock", /^2\.00 s/);
  const again = await FakeServer.start({}, null, port);
  again.tellUntil(3);
  // By then, the page may have tried by itself.
  await page.evaluate(() => (document.querySelector("#retry") as HTMLElement).click());
  await waitForText(page, "#run-status", /^Moving$/);
  await waitForText(page, "#clock", /^3\.00 s/);
  await page.context().close();
  await again.close();
});

test("the verdict is shown, and stays when the run is gone", kLong, async () => {
  const server = await FakeServer.start();
  server.tellUntil(kDuration_s);
  const { page } = await openPage(browser, server.url);
  await waitForText(page, "#run-status", /^Ended: succeeded$/);
  await waitForText(page, "#scene-note", /^The goal is reached/);
  await server.close();
  await page.waitForFunction(() => document.documentElement.dataset["connection"] === "lost");
  await waitForText(page, "#run-status", /^Ended: succeeded$/);
  await page.context().close();
});

test("contacts say whose they were, each in a colour of its own", kLong, async () => {
  const server = await FakeServer.start();
  server.tellUntil(1);
  const { page } = await openPage(browser, server.url);
  await waitForText(page, "#clock", /^1\.00 s/);
  for (const by of ["robot", "others"]) {
    server.tellRaw(encode({ kind: "event", time_s: 0.5, event: `contact_by_${by}`, reason: "contact", cause: "base and walker" }));
  }
  await waitForText(page, "#events", /contact by others.*contact by robot/);
  const colourOf = (by: string) =>
    page.locator(`.event-name[data-event=contact_by_${by}]`).evaluate((name) => getComputedStyle(name).color);
  assert.notEqual(await colourOf("robot"), await colourOf("others"));
  await page.context().close();
  await server.close();
});

test("a message that cannot be read is told of, and does not stop the next", kLong, async () => {
  const server = await FakeServer.start();
  server.tellUntil(1);
  const { page, complaints } = await openPage(browser, server.url);
  await waitForText(page, "#clock", /^1\.00 s/);
  server.tellRaw(new Uint8Array([9, 0, 0, 0, 1, 2]).buffer);
  await waitForText(page, "#scene-note", /^A message could not be read, the first since the header's length/);
  server.tellUntil(2);
  await waitForText(page, "#clock", /^2\.00 s/);
  assert.deepEqual(complaints, []);
  await page.context().close();
  await server.close();
});

test("without WebGL the rest works, and the page says what does not", kLong, async () => {
  const server = await FakeServer.start();
  server.tellUntil(4);
  const context = await browser.newContext();
  await context.addInitScript(() => {
    const original = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (this: HTMLCanvasElement, kind: string, ...rest: unknown[]) {
      return kind.startsWith("webgl") ? null : (original as (...all: unknown[]) => unknown).call(this, kind, ...rest);
    } as typeof original;
  });
  const page = await context.newPage();
  await page.goto(server.url);
  await waitForText(page, "#card-title", /does not draw in three dimensions/);
  await waitForText(page, "#clock", /^4\.00 s/);
  server.tellUntil(5);
  await waitForText(page, "#medians-mapping", /^\d+\.\d \/ \d+\.\d$/);
  await page.waitForFunction(() => document.querySelector("#depth-image")?.getAttribute("width") === "64");
  await context.close();
  await server.close();
});

test("a recording is played from its beginning, and all of it is kept", kLong, async () => {
  const server = await FakeServer.start({ recorded: true });
  server.tellUntil(kDuration_s);
  const { page } = await openPage(browser, server.url);
  await waitForText(page, "#live", /^To the end$/);
  await page.keyboard.press(" ");
  await page.waitForFunction(() => document.documentElement.dataset["mode"] === "paused");
  // Paused or not, what the server still sends is taken in: on a slow machine that is most of the recording.
  await page.waitForFunction(
    (end_s) => Math.abs(Number(document.querySelector("#scrub")?.getAttribute("max")) - end_s) < 0.005,
    kDuration_s,
  );
  assert.equal(await page.locator("#scrub").getAttribute("min"), "0");
  await page.keyboard.press("l");
  await waitForText(page, "#run-status", /^Ended: succeeded$/);
  await page.context().close();
  await server.close();
});

test("everything can be reached and named without a mouse", kLong, async () => {
  const server = await FakeServer.start();
  server.tellUntil(4);
  const { page } = await openPage(browser, server.url);
  await waitForText(page, "#clock", /^4\.00 s/);
  const nameless = await page.evaluate(() =>
    [...document.querySelectorAll<HTMLElement>("button, input, select, canvas[role], dialog")]
      .filter((one) => {
        const labels = one instanceof HTMLInputElement || one instanceof HTMLSelectElement ? [...(one.labels ?? [])] : [];
        const by = one.getAttribute("aria-labelledby");
        const text = [one.getAttribute("aria-label"), one.tagName === "BUTTON" ? one.textContent : "", ...labels.map((label) => label.textContent), by];
        return text.every((part) => (part ?? "").trim() === "");
      })
      .map((one) => one.outerHTML),
  );
  assert.deepEqual(nameless, []);
  const visited = new Set<string>();
  for (let i = 0; i < 60; ++i) {
    await page.keyboard.press("Tab");
    visited.add(await page.evaluate(() => document.activeElement?.id ?? ""));
  }
  for (const id of ["theme", "help-open", "scene", "overlay-robot", "slice-position", "play", "live", "scrub", "speed"]) {
    assert.ok(visited.has(id), `${id} among ${[...visited].join(" ")}`);
  }
  await page.keyboard.press("?");
  assert.equal(await page.locator("#help").evaluate((help) => (help as HTMLDialogElement).open), true);
  await page.keyboard.press("Escape");
  assert.equal(await page.locator("#help").evaluate((help) => (help as HTMLDialogElement).open), false);
  await page.context().close();
  await server.close();
});

test("overlays and theme are remembered", kLong, async () => {
  const server = await FakeServer.start();
  server.tellUntil(1);
  const { page } = await openPage(browser, server.url, { colorScheme: "dark" });
  await waitForText(page, "#clock", /^1\.00 s/);
  assert.equal(await page.locator("html").getAttribute("data-theme"), "dark");
  await page.keyboard.press("d");
  await page.keyboard.press("2");
  await page.keyboard.press("3");
  await page.reload();
  await waitForText(page, "#clock", /^1\.00 s/);
  assert.equal(await page.locator("html").getAttribute("data-theme"), "light");
  assert.equal(await page.locator("#overlay-spheres").isChecked(), true);
  assert.equal(await page.locator("#overlay-voxels").isChecked(), false);
  assert.equal(await page.locator("#overlay-robot").isChecked(), true);
  await page.context().close();
  await server.close();
});

for (const [width, height] of [[1280, 800], [768, 1024], [1024, 768]]) {
  test(`nothing lies outside of the page or over another part at ${width} x ${height}`, kLong, async () => {
    const server = await FakeServer.start();
    server.tellUntil(4);
    const { page } = await openPage(browser, server.url, { viewport: { width, height } });
    await waitForText(page, "#clock", /^4\.00 s/);
    const faults = await page.evaluate(() => {
      const found: string[] = [];
      if (document.documentElement.scrollWidth > innerWidth) found.push("the page scrolls sideways");
      for (const one of document.querySelectorAll<HTMLElement>("button, input, select, output, .track-name, .track-medians, h2")) {
        const box = one.getBoundingClientRect();
        if (box.width === 0 || one.closest("dialog") !== null) continue;
        if (box.left < -0.5 || box.right > innerWidth + 0.5) found.push(`${one.id || one.textContent} is cut off`);
      }
      const parts = [".bar", ".stage", ".panel", ".dock"].map((name) => (document.querySelector(name) as HTMLElement).getBoundingClientRect());
      parts.forEach((a, i) => {
        if (a.width < 200 || a.height < 40 || a.bottom > innerHeight + 1) found.push(`part ${i} is too small or outside`);
        for (const b of parts.slice(i + 1)) {
          const apart = a.right <= b.left + 1 || b.right <= a.left + 1 || a.bottom <= b.top + 1 || b.bottom <= a.top + 1;
          if (!apart) found.push(`part ${i} lies over another`);
        }
      });
      if (parts[1].height < 300) found.push(`the scene is ${parts[1].height} high`);
      return found;
    });
    assert.deepEqual(faults, []);
    await page.context().close();
    await server.close();
  });
}
