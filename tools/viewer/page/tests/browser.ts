// Headless Chromium, and what end-to-end tests ask of a page.
import { Browser, BrowserContextOptions, chromium, Page } from "playwright-core";

export const kWait_ms = 60_000;

export async function openBrowser(): Promise<Browser> {
  return chromium.launch({
    executablePath: process.env["SIDESTEP_CHROMIUM"] ?? "/usr/bin/chromium",
    args: [
      ...["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
      ...["--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"],
    ],
  });
}

/** A page of its own, with what it complained of. */
export interface Watched {
  page: Page;
  complaints: string[];
}

export async function openPage(browser: Browser, url: string, options: BrowserContextOptions = {}): Promise<Watched> {
  const context = await browser.newContext({ viewport: { width: 1280, height: 800 }, ...options });
  context.setDefaultTimeout(kWait_ms);
  const page = await context.newPage();
  const complaints: string[] = [];
  page.on("pageerror", (error) => complaints.push(String(error)));
  page.on("console", (message) => {
    // A lost connection is told of by the browser itself.
    const expected = /WebSocket connection|GPU stall|GL Driver Message|ERR_CONNECTION_REFUSED/.test(message.text());
    if (message.type() === "error" && !expected) complaints.push(message.text());
  });
  await page.goto(url);
  return { page, complaints };
}

/** Waits until the page shows a text somewhere in an element. */
export async function waitForText(page: Page, selector: string, pattern: RegExp): Promise<void> {
  await page.waitForFunction(
    ([where, source]) => new RegExp(source).test(document.querySelector(where)?.textContent ?? ""),
    [selector, pattern.source],
  );
}

/** Until the scene has been drawn again after what went before, and no block waits to be meshed. */
export async function settle(page: Page): Promise<void> {
  await page.evaluate(
    () =>
      new Promise<void>((done) => {
        const canvas = document.querySelector<HTMLCanvasElement>("#scene") as HTMLCanvasElement;
        let last = "";
        let same = 0;
        const look = () => {
          const now = `${canvas.dataset["frames"]} ${canvas.dataset["quads"]}`;
          same = now === last ? same + 1 : 0;
          last = now;
          if (same >= 8) done();
          else requestAnimationFrame(look);
        };
        requestAnimationFrame(look);
      }),
  );
}

/** The pixels of the scene's part of a screenshot: RGBA, row by row. */
export async function scenePixels(page: Page): Promise<Uint8Array> {
  await settle(page);
  const png = await page.locator("#scene").screenshot();
  const reader = await (page.context().browser() as Browser).newPage();
  try {
    const pixels = await reader.evaluate(async (base64) => {
      const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
      const canvas = new OffscreenCanvas(image.width, image.height);
      const context = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
      context.drawImage(image, 0, 0);
      const { data } = context.getImageData(0, 0, image.width, image.height);
      let text = "";
      for (let i = 0; i < data.length; i += 8192) text += String.fromCharCode(...data.subarray(i, i + 8192));
      return btoa(text);
    }, png.toString("base64"));
    return Buffer.from(pixels, "base64");
  } finally {
    await reader.close();
  }
}

/** How many pixels differ visibly. */
export function differingPixels(a: Uint8Array, b: Uint8Array): number {
  if (a.length !== b.length) throw new Error("pictures of different sizes");
  let count = 0;
  for (let i = 0; i < a.length; i += 4) {
    const most = Math.max(...[0, 1, 2].map((channel) => Math.abs(a[i + channel] - b[i + channel])));
    if (most > 12) ++count;
  }
  return count;
}

/** Sets an overlay by its box in the panel. */
export async function setOverlay(page: Page, id: string, shown: boolean): Promise<void> {
  await page.locator(`#overlay-${id}`).setChecked(shown);
}
