// Opens a page in headless Chromium, in the dark, and takes its picture. Fails where it complains.
import { chromium } from "playwright-core";

/** `prepare` brings the page to what is to be seen. */
export async function takePicture(url, file, prepare) {
  const complaints = [];
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
    page.on("pageerror", (error) => complaints.push(error.message));
    page.on("console", (message) => {
      if (message.type() === "error") complaints.push(message.text());
    });
    await page.emulateMedia({ colorScheme: "dark" });
    await page.goto(url);
    await prepare(page);
    await page.screenshot({ path: file });
  } finally {
    await browser.close();
  }
  if (complaints.length > 0) {
    console.error(complaints.join("\n"));
    process.exit(1);
  }
}
