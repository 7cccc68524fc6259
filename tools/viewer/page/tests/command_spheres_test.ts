// The sphere editor in headless Chromium, served by the command itself, on a profile of its own.
//
// SIDESTEP_COMMAND is the command, SIDESTEP_ROBOTS the folder of the profiles that come along.
import assert from "node:assert/strict";
import { ChildProcess, spawn } from "node:child_process";
import { once } from "node:events";
import { cp, mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import path from "node:path";
import { after, before, test, TestContext } from "node:test";
import type { Browser, Page } from "playwright-core";
import { WebSocket } from "ws";
import { differingPixels, kWait_ms, openBrowser, openPage, scenePixels, settle, waitForText } from "./browser";

const kLong = { timeout: 3 * kWait_ms };
const kCommand = process.env["SIDESTEP_COMMAND"] ?? "";
const kRobots = process.env["SIDESTEP_ROBOTS"] ?? "";

let browser: Browser;
before(async () => {
  browser = await openBrowser();
});
after(() => browser.close());

interface Served {
  profile: string;
  url: string;
}

/** A copy of a robot's profile, and the editor on it, until the test has ended. */
async function serve(context: TestContext, robot: string, ...options: string[]): Promise<Served> {
  const folder = await mkdtemp(path.join(tmpdir(), "spheres-"));
  await cp(path.join(kRobots, robot), folder, { recursive: true });
  const profile = path.join(folder, "profile.yaml");
  const command = spawn(kCommand, ["robot", profile, "--spheres", ...options], { stdio: ["ignore", "ignore", "pipe"] });
  let said = "";
  for await (const piece of command.stderr as AsyncIterable<Buffer>) {
    said += String(piece);
    if (/spheres are saved into/.test(said)) break;
  }
  context.after(() => end({ folder, command }));
  const url = /viewer: (\S+)/.exec(said)?.[1];
  assert.ok(url !== undefined, said);
  return { profile, url };
}

async function end({ folder, command }: { folder: string; command: ChildProcess }): Promise<void> {
  command.kill("SIGTERM");
  if (command.exitCode === null) await once(command, "exit");
  await rm(folder, { recursive: true });
}

async function openEditor(served: Served): Promise<{ page: Page; complaints: string[] }> {
  const watched = await openPage(browser, served.url);
  await waitForText(watched.page, "#run-status", /^As in the file$/);
  return watched;
}

const kFields = ["centre-x", "centre-y", "centre-z", "radius"];
const field = (page: Page, id: string) => page.locator(`#${id}`).inputValue();

test("robot and spheres are drawn, and figures stand beside them", kLong, async (context) => {
  const served = await serve(context, "panda");
  const { page, complaints } = await openEditor(served);
  await waitForText(page, "#sphere-count", /^62$/);
  await waitForText(page, "#whole", /^All links62/);
  const all = await scenePixels(page);
  await page.locator("#show-shapes").uncheck();
  const shapeless = await scenePixels(page);
  assert.ok(differingPixels(all, shapeless) > 1500, `shapes: ${differingPixels(all, shapeless)} pixels`);
  await page.keyboard.press("n");
  await waitForText(page, "#sphere-link", /^on panda_link0$/);
  const selected = await scenePixels(page);
  assert.ok(differingPixels(shapeless, selected) > 300, `selected: ${differingPixels(shapeless, selected)} pixels`);
  await page.locator("#radius").fill("400");
  const large = await scenePixels(page);
  assert.ok(differingPixels(selected, large) > 5000, `larger: ${differingPixels(selected, large)} pixels`);
  await page.locator("#undo").click();
  await page.keyboard.press("Escape");
  assert.ok(differingPixels(await scenePixels(page), shapeless) < 50);
  assert.deepEqual(complaints, []);
  await page.context().close();
});

test("what is moved, sized, added and removed is saved, and only that", kLong, async (context) => {
  const served = await serve(context, "ur5e");
  const before = await readFile(served.profile, "utf-8");
  const { page, complaints } = await openEditor(served);
  await page.keyboard.press("n");
  const was = await Promise.all(kFields.map((id) => field(page, id)));
  for (const key of ["ArrowRight", "ArrowRight", "Shift+ArrowUp", "PageDown", "-"]) await page.keyboard.press(key);
  const now = await Promise.all(kFields.map((id) => field(page, id)));
  assert.deepEqual(now.map((value, i) => Math.round(10 * (Number(value) - Number(was[i])))), [100, 10, -50, -50]);
  await waitForText(page, "#run-status", /^Changed, not saved$/);
  // Something is not held any more.
  await page.waitForFunction(() => document.querySelector("#gap")?.getAttribute("data-tone") === "bad");
  assert.equal(await readFile(served.profile, "utf-8"), before, "nothing is written before it is asked for");
  await page.keyboard.press("a");
  await page.locator("#radius").fill("42.5");
  await page.locator("#save").click();
  await waitForText(page, "#scene-note", /^Saved\.$/);
  await waitForText(page, "#run-status", /^As in the file$/);
  const after = await readFile(served.profile, "utf-8");
  const lines = (text: string) => text.split("\n");
  const fresh = lines(after).filter((line) => !lines(before).includes(line));
  assert.equal(fresh.length, 2, after);
  const [x, y, z, radius] = now.map((value) => String(Number((Number(value) / 1000).toFixed(4))));
  assert.ok(fresh[0].endsWith(`centre_m: [${x}, ${y}, ${z}], radius_m: ${radius}}`), `${fresh[0]}: ${now.join(" ")}`);
  assert.match(fresh[1], /radius_m: 0\.0425\}$/);
  assert.deepEqual(lines(before).filter((line) => !lines(after).includes(line)).length, 1);
  // Removed and undone; what was saved can be undone as well.
  await page.keyboard.press("Escape");
  await page.locator("#scene").focus();
  await page.keyboard.press("n");
  await page.keyboard.press("Delete");
  await waitForText(page, "#sphere-count", /^31$/);
  await page.keyboard.press("z");
  await waitForText(page, "#sphere-count", /^32$/);
  assert.deepEqual(complaints, []);
  await page.context().close();
});

test("a sphere is dragged by its handle in the scene", kLong, async (context) => {
  const served = await serve(context, "planar");
  const { page } = await openEditor(served);
  await page.keyboard.press("n");
  await settle(page);
  const [x, y] = ((await page.locator("#scene").getAttribute("data-selected")) ?? "").split(" ").map(Number);
  const box = await page.locator("#scene").boundingBox();
  assert.ok(box !== null);
  // The square in the middle of the handles moves across the view.
  await page.mouse.move(box.x + x, box.y + y);
  await settle(page);
  await page.mouse.down();
  await page.mouse.move(box.x + x + 30, box.y + y - 60, { steps: 5 });
  await page.mouse.move(box.x + x + 40, box.y + y - 80, { steps: 5 });
  await page.mouse.up();
  await waitForText(page, "#run-status", /^Changed, not saved$/);
  const moved = await Promise.all(["x", "y", "z"].map((axis) => field(page, `centre-${axis}`)));
  assert.ok(moved.some((value) => Math.abs(Number(value)) > 20), moved.join(" "));
  // One drag is one step.
  await page.locator("#undo").click();
  await waitForText(page, "#run-status", /^As in the file$/);
  await page.context().close();
});

test("a fit covers everything, and is saved", kLong, async (context) => {
  const served = await serve(context, "ur5e");
  const { page } = await openEditor(served);
  await page.locator("#fit-kind").selectOption("count");
  await page.locator("#fit-value").fill("20");
  await page.locator("#fit").click();
  await page.waitForFunction(() => Number(document.querySelector("#sphere-count")?.textContent) <= 20);
  await waitForText(page, "#gap", /^none$/);
  await page.locator("#scene").focus();
  await page.keyboard.press("w");
  await waitForText(page, "#scene-note", /^Saved\.$/);
  const text = await readFile(served.profile, "utf-8");
  const count = Number(await page.locator("#sphere-count").textContent());
  assert.equal((text.match(/radius_m/g) ?? []).length, count);
  assert.match(text, /# They cover the URDF's shapes/);
  await page.context().close();
});

test("a wrong token and a foreign page are refused", kLong, async (context) => {
  const served = await serve(context, "planar", "--view-bind", "127.0.0.1");
  assert.match(served.url, /\?token=[0-9a-f]{32}$/);
  const { page } = await openEditor(served);
  await page.context().close();
  for (const token of ["", "?token=0123456789abcdef0123456789abcdef"]) {
    const answer = await fetch(served.url.replace(/\?.*/, token));
    assert.equal(answer.status, 403);
  }
  const wrong = new URL(served.url);
  const socket = new WebSocket(`ws://${wrong.host}/socket?token=wrong`);
  const [event] = (await Promise.race([once(socket, "error"), once(socket, "open")])) as [Event];
  assert.equal(event instanceof Error, true, "the socket was opened with a wrong token");
  const other = new WebSocket(`ws://${wrong.host}/socket${wrong.search}`, { origin: "http://elsewhere.example" });
  const [refused] = (await Promise.race([once(other, "error"), once(other, "open")])) as [Event];
  assert.equal(refused instanceof Error, true, "another site's page was let in");
});

for (const [width, height] of [[1280, 800], [768, 1024], [1024, 768]]) {
  test(`nothing lies outside of the editor's page at ${width} x ${height}`, kLong, async (context) => {
    const served = await serve(context, "hsr");
    const { page } = await openPage(browser, served.url, { viewport: { width, height } });
    await waitForText(page, "#run-status", /^As in the file$/);
    const faults = await page.evaluate(() => {
      const found: string[] = [];
      if (document.documentElement.scrollWidth > innerWidth) found.push("the page scrolls sideways");
      for (const one of document.querySelectorAll<HTMLElement>("button, input, select, h2, td, dd")) {
        const box = one.getBoundingClientRect();
        if (box.width === 0 || one.closest("dialog") !== null) continue;
        if (box.left < -0.5 || box.right > innerWidth + 0.5) found.push(`${one.id || one.textContent} is cut off`);
      }
      for (const one of document.querySelectorAll<HTMLElement>("button, input, select")) {
        const labels = one instanceof HTMLButtonElement ? [] : [...((one as HTMLInputElement).labels ?? [])];
        const names = [one.getAttribute("aria-label"), one.textContent, ...labels.map((label) => label.textContent)];
        if (names.every((name) => (name ?? "").trim() === "")) found.push(`${one.id} has no name`);
      }
      return found;
    });
    assert.deepEqual(faults, []);
    await page.context().close();
    });
}
