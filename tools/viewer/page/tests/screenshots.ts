// Pictures of the page in all its states, to look at.
//
//   node build/tests/screenshots.js FOLDER
import { mkdir } from "node:fs/promises";
import path from "node:path";
import { openBrowser, openPage, setOverlay, settle, waitForText } from "./browser";
import { FakeServer } from "./fake_server";

const folder = process.argv[2] ?? "build/screenshots";
await mkdir(folder, { recursive: true });
const browser = await openBrowser();

const kPages = [["light", 768, 1024], ["dark", 1280, 800], ["light", 1280, 800], ["dark", 768, 1024]] as const;
for (const [colorScheme, width, height] of kPages) {
  const server = await FakeServer.start();
  const { page, complaints } = await openPage(browser, server.url, { colorScheme, viewport: { width, height } });
  const shoot = async (name: string) => {
    await settle(page);
    await page.screenshot({ path: path.join(folder, `${name}-${colorScheme}-${width}.png`) });
  };
  await page.waitForFunction(() => document.documentElement.dataset["connection"] === "open");
  server.tellUntil(9.3);
  await setOverlay(page, "slice", true);
  await server.heard(/"axis":"z"/);
  server.tellUntil(9.4);
  await waitForText(page, "#clock", /^9\.40 s/);
  await shoot("slice");
  await setOverlay(page, "slice", false);
  server.tellUntil(13);
  await waitForText(page, "#clock", /^13\.00 s/);
  await shoot("plain");
  for (const id of ["swept", "unknown", "spheres"]) await setOverlay(page, id, true);
  await shoot("overlays");
  for (const id of ["swept", "unknown", "spheres"]) await setOverlay(page, id, false);
  await page.keyboard.press("t");
  await shoot("top");
  await page.keyboard.press("?");
  await shoot("help");
  await page.keyboard.press("Escape");
  await page.keyboard.press("f");
  await page.locator("#joints-section summary").click();
  server.tellUntil(24);
  await waitForText(page, "#clock", /^24\.00 s/);
  await shoot("ended");
  await server.close();
  await page.waitForFunction(() => document.documentElement.dataset["connection"] === "lost");
  console.log(colorScheme, width, complaints);
  await page.context().close();
}

const hall = await FakeServer.start({ place: "hall" });
hall.tellUntil(0);
const { page } = await openPage(browser, hall.url, { colorScheme: "dark" });
await waitForText(page, "#run-title", /hall/);
await settle(page);
await page.screenshot({ path: path.join(folder, "hall-dark-1280.png") });
console.log("hall:", await page.locator("#scene").getAttribute("data-quads"), "rectangles");
await hall.close();
await waitForText(page, "#run-status", /lost/);
await page.screenshot({ path: path.join(folder, "lost-dark-1280.png") });
await browser.close();
