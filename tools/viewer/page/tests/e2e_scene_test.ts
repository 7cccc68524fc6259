// What is drawn, by its pixels, in headless Chromium.
import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import type { Browser, Page } from "playwright-core";
import { differingPixels, kWait_ms, openBrowser, openPage, scenePixels, setOverlay, waitForText } from "./browser";
import { FakeServer } from "./fake_server";
import type { RunOptions } from "./synthetic_run";
import { configuration } from "./synthetic_world";

let browser: Browser;
before(async () => {
  browser = await openBrowser();
});
after(() => browser.close());

/** A page that shows a run live at `time_s`. */
async function watch(time_s: number, options: Partial<RunOptions> = {}): Promise<{ server: FakeServer; page: Page; complaints: string[] }> {
  const server = await FakeServer.start(options);
  server.tellUntil(time_s);
  const { page, complaints } = await openPage(browser, server.url);
  await waitForClock(page, time_s);
  return { server, page, complaints };
}

async function waitForClock(page: Page, time_s: number): Promise<void> {
  await waitForText(page, "#clock", new RegExp(`^${time_s.toFixed(2)} s`));
}

async function close({ server, page }: { server: FakeServer; page: Page }): Promise<void> {
  await page.context().close();
  await server.close();
}

async function scrubTo(page: Page, time_s: number): Promise<void> {
  await page.evaluate((value) => {
    const scrub = document.querySelector("#scrub") as HTMLInputElement;
    scrub.value = String(value);
    scrub.dispatchEvent(new Event("input", { bubbles: true }));
  }, time_s);
  await waitForClock(page, time_s);
}

test("robot and voxels are drawn, and hidden when they are not wanted", { timeout: 3 * kWait_ms }, async () => {
  const [whole, robotless, voxelless] = [await watch(4), await watch(4, { robot: false }), await watch(4, { voxels: false })];
  for (const { page } of [whole, robotless, voxelless]) await setOverlay(page, "goal", false);
  const all = await scenePixels(whole.page);
  const [noRobot, noVoxels] = [await scenePixels(robotless.page), await scenePixels(voxelless.page)];
  assert.ok(differingPixels(all, noRobot) > 1500, `robot: ${differingPixels(all, noRobot)} pixels`);
  assert.ok(differingPixels(all, noVoxels) > 30000, `voxels: ${differingPixels(all, noVoxels)} pixels`);
  // Hidden, each leaves what a run without it shows.
  await setOverlay(whole.page, "voxels", false);
  assert.ok(differingPixels(await scenePixels(whole.page), noVoxels) < 50);
  await setOverlay(whole.page, "voxels", true);
  await setOverlay(whole.page, "robot", false);
  assert.ok(differingPixels(await scenePixels(whole.page), noRobot) < 50);
  for (const one of [whole, robotless, voxelless]) {
    assert.deepEqual(one.complaints, []);
    await close(one);
  }
});

test("every overlay changes the picture, and only while it is on", { timeout: 3 * kWait_ms }, async () => {
  const watched = await watch(3.5);
  const { page, server } = watched;
  await setOverlay(page, "slice", true);
  await server.heard(/"axis":"z"/);
  server.tellUntil(3.6);
  await waitForText(page, "#slice-note", /^$/);
  await setOverlay(page, "slice", false);
  const usual = await scenePixels(page);
  const ids = await page.locator("#overlays input").evaluateAll((boxes) => boxes.map((box) => box.id.replace("overlay-", "")));
  assert.equal(ids.length, 16);
  for (const id of ids) {
    const was = await page.locator(`#overlay-${id}`).isChecked();
    await setOverlay(page, id, !was);
    const other = await scenePixels(page);
    await setOverlay(page, id, was);
    // At 3.6 s there is one followed plan only at 0 s and a refused one at 3 s: nothing came before.
    const expected = id !== "previous";
    assert.equal(differingPixels(usual, other) > 20, expected, `${id}: ${differingPixels(usual, other)} pixels`);
  }
  assert.ok(differingPixels(usual, await scenePixels(page)) < 20);
  await close(watched);
});

test("voxels are drawn as they change", { timeout: 2 * kWait_ms }, async () => {
  const watched = await watch(2);
  const { page, server } = watched;
  for (const id of ["robot", "goal", "camera", "clearance", "tracks", "predicted", "moving", "followed", "refused"]) await setOverlay(page, id, false);
  const before_ = await scenePixels(page);
  assert.ok(differingPixels(before_, await scenePixels(page)) < 20, "it stands still by itself");
  server.tellUntil(5);
  await waitForClock(page, 5);
  assert.ok(differingPixels(before_, await scenePixels(page)) > 1000);
  await close(watched);
});

test("scrubbing back shows what was shown then", { timeout: 3 * kWait_ms }, async () => {
  const watched = await watch(4);
  const { page, server } = watched;
  const then = await scenePixels(page);
  const quads = await page.locator("#scene").getAttribute("data-quads");
  server.tellUntil(9);
  await waitForClock(page, 9);
  const now = await scenePixels(page);
  assert.ok(differingPixels(then, now) > 2000);
  await page.locator("#joints-section summary").click();
  await scrubTo(page, 4);
  await waitForText(page, ".joint-value", new RegExp(`^${configuration(4)[0].toFixed(3)} m$`));
  assert.ok(differingPixels(then, await scenePixels(page)) < 50, `${differingPixels(then, await scenePixels(page))} pixels`);
  assert.equal(await page.locator("#scene").getAttribute("data-quads"), quads);
  // It stays there while the run goes on, and finds its way back.
  server.tellUntil(9.5);
  await page.waitForFunction(() => Number((document.querySelector("#scrub") as HTMLInputElement).max) > 9.4);
  await waitForText(page, "#clock", /^4\.00 s {2}\(−5\.5\)$/);
  await page.keyboard.press("ArrowRight");
  await waitForClock(page, 4.1);
  await page.keyboard.press("ArrowRight");
  await waitForClock(page, 4.2);
  await page.keyboard.press("ArrowLeft");
  await waitForClock(page, 4.1);
  await page.keyboard.press("l");
  await waitForClock(page, 9.5);
  assert.equal(await page.locator("html").getAttribute("data-mode"), "live");
  await close(watched);
});

test("the slice moves by keys, by its slider and by its handle", { timeout: 3 * kWait_ms }, async () => {
  const watched = await watch(3);
  const { page, server } = watched;
  const isAsked = async (axis: string, at: (position_m: number) => boolean) => {
    for (;;) {
      const { slice } = JSON.parse(await server.heard(/"axis"/)) as { slice: { axis: string; position_m: number } };
      if (slice.axis === axis && at(slice.position_m)) return slice.position_m;
      await server.hearNext();
    }
  };
  const shown = async () => {
    server.tellUntil(server.time_s + 0.1);
    await waitForClock(page, server.time_s);
    await waitForText(page, "#slice-note", /^$/);
    return scenePixels(page);
  };
  await page.keyboard.press("5");
  const first_m = await isAsked("z", (z) => Math.abs(z - 0.5) < 0.05);
  const first = await shown();
  for (let i = 0; i < 6; ++i) await page.keyboard.press("ArrowUp");
  await isAsked("z", (z) => Math.abs(z - first_m - 0.3) < 1e-6);
  assert.ok(differingPixels(first, await shown()) > 5000);
  await page.evaluate(() => {
    const slider = document.querySelector("#slice-position") as HTMLInputElement;
    slider.value = "1.075";
    slider.dispatchEvent(new Event("input", { bubbles: true }));
  });
  await isAsked("z", (z) => Math.abs(z - 1.075) < 0.03);
  const box = (await page.locator("#scene").boundingBox()) as { x: number; y: number; width: number; height: number };
  const handle = await page.locator("#scene").getAttribute("data-handle");
  const [x, y] = (handle as string).split(" ").map(Number);
  await page.mouse.move(box.x + x, box.y + y);
  await page.mouse.down();
  await page.mouse.move(box.x + x, box.y + y + 40, { steps: 4 });
  await page.mouse.up();
  await isAsked("z", (z) => z < 1.0);
  await page.keyboard.press("x");
  await isAsked("x", () => true);
  assert.ok(differingPixels(first, await shown()) > 5000);
  await page.keyboard.press("5");
  await server.heard(/^\{"slice":null\}$/);
  await close(watched);
});

test("predictions and slice are shown at the time ahead", { timeout: 2 * kWait_ms }, async () => {
  const watched = await watch(3);
  const { page, server } = watched;
  const now = await scenePixels(page);
  await page.keyboard.press("]");
  await waitForText(page, "#ahead-value", /^0\.5 s$/);
  const soon = await scenePixels(page);
  assert.ok(differingPixels(now, soon) > 300, `${differingPixels(now, soon)} pixels`);
  for (let i = 0; i < 5; ++i) await page.keyboard.press("]");
  assert.ok(differingPixels(soon, await scenePixels(page)) > 300);
  for (let i = 0; i < 7; ++i) await page.keyboard.press("[");
  await waitForText(page, "#ahead-value", /^now$/);
  assert.ok(differingPixels(now, await scenePixels(page)) < 20);
  await page.keyboard.press("5");
  await server.heard(/"ahead_s":0}/);
  const shown = async () => {
    server.tellUntil(server.time_s + 0.1);
    await waitForText(page, "#slice-note", /^$/);
    return scenePixels(page);
  };
  for (const id of ["tracks", "predicted", "moving"]) await setOverlay(page, id, false);
  const then = await shown();
  await page.keyboard.press("]");
  await server.heard(/"ahead_s":0.5}/);
  assert.ok(differingPixels(then, await shown()) > 300);
  await close(watched);
});
