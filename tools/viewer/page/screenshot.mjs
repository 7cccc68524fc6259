// A picture of a recording in the viewer: node screenshot.mjs URL FILE [SHARE]
// SHARE of its time is where it is shown, 0.5 unless given.
import { chromium } from "playwright-core";

const [url, file, share = "0.5"] = process.argv.slice(2);
const browser = await chromium.launch({
  executablePath: "/usr/bin/chromium",
  args: [
    "--no-sandbox", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--use-gl=angle",
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
  ],
});
try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  await page.emulateMedia({ colorScheme: "dark" });
  await page.goto(url);
  // All of the recording has come once its end is told.
  await page.waitForFunction(
    () => /reached|the goal|failed/i.test(document.querySelector("header")?.textContent ?? ""),
    undefined, { timeout: 60000 },
  ).catch(() => undefined);
  await page.evaluate((at) => {
    const scrub = document.querySelector("#scrub");
    const [from, to] = [Number(scrub.min), Number(scrub.max)];
    scrub.value = String(from + (to - from) * at);
    scrub.dispatchEvent(new Event("input", { bubbles: true }));
  }, Number(share));
  await page.evaluate(() => new Promise((drawn) => {
    let frames = 30;
    const next = () => (--frames > 0 ? requestAnimationFrame(next) : drawn(undefined));
    requestAnimationFrame(next);
  }));
  await page.screenshot({ path: file });
} finally {
  await browser.close();
}
