// A picture of a recording in the viewer: node screenshot.mjs URL FILE [SHARE [UNTIL COUNT]]
// SHARE of its time is where it is shown, 0.5 unless given; with UNTIL, COUNT pictures of the scene
// alone, from SHARE to there, FILE.000.png and so on. Fails where the page complains, or shows no
// recording.
import { takePicture } from "./picture.mjs";

const kPatience_ms = 60000;
const kLook_ms = 500;

const [url, file, share = "0.5", until, count = "1"] = process.argv.slice(2);
await takePicture(url, file, async (page) => {
  const end = () => page.evaluate(() => Number(document.querySelector("#scrub")?.max ?? 0));
  // All of it has come once its end moves no more.
  let [last, steady] = [0, 0];
  for (let waited_ms = 0; steady < 4; waited_ms += kLook_ms) {
    if (waited_ms > kPatience_ms) throw new Error("there is no recording to be seen");
    await page.waitForTimeout(kLook_ms);
    const now = await end();
    steady = now > 1 && now === last ? steady + 1 : 0;
    last = now;
  }
  const show = (at) => page.evaluate((part) => {
    const scrub = document.querySelector("#scrub");
    const [from, to] = [Number(scrub.min), Number(scrub.max)];
    scrub.value = String(from + (to - from) * part);
    scrub.dispatchEvent(new Event("input", { bubbles: true }));
  }, at);
  await show(Number(share));
  await page.waitForTimeout(4 * kLook_ms);
  if (until === undefined) return;
  const clip = await page.locator("canvas").first().boundingBox();
  for (let i = 0; i < Number(count); ++i) {
    await show(Number(share) + ((Number(until) - Number(share)) * i) / (Number(count) - 1));
    await page.waitForTimeout(kLook_ms);
    await page.screenshot({ path: `${file}.${String(i).padStart(3, "0")}.png`, clip });
  }
});
