// A picture of the sphere editor, with one sphere selected: node screenshot_spheres.mjs URL FILE [LINK]
import { takePicture } from "./picture.mjs";

const [url, file, link] = process.argv.slice(2);
await takePicture(url, file, async (page) => {
  await page.waitForFunction(() => document.querySelector("#run-status")?.textContent === "As in the file");
  if (link !== undefined) await page.locator(".link-name", { hasText: link }).first().click();
  await page.keyboard.press("n");
  await page.evaluate(() => document.activeElement?.blur());
  await page.waitForTimeout(2000);
});
