// Chromium without a display, with a page of the viewer in it.
import { existsSync } from "node:fs";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import puppeteer from "puppeteer-core";

const NAMES = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];

/** Path of a Chromium: CHROMIUM, or where systems keep it; `null` where there is none. */
export function findChromium() {
  const named = process.env.CHROMIUM;
  return [...(named ? [named] : []), ...NAMES].find((path) => existsSync(path)) ?? null;
}

/** Runs `use(open)`; `open(url, size)` gives a page and the list of what its console complains of. */
export async function withBrowser(use) {
  const profile = await mkdtemp(join(tmpdir(), "eagpt-viewer-"));
  const browser = await puppeteer.launch({
    executablePath: findChromium(),
    userDataDir: profile,
    protocolTimeout: 600_000,
    args: [
      "--no-sandbox",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
      "--disable-quic",
      "--no-first-run",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
    ],
  });
  try {
    return await use(async (url, { width = 960, height = 600 } = {}) => {
      const page = await browser.newPage();
      const complaints = [];
      page.on("console", (message) => {
        if (message.type() === "error") complaints.push(message.text());
      });
      page.on("pageerror", (error) => complaints.push(String(error)));
      await page.setViewport({ width, height });
      await page.goto(url);
      try {
        await page.waitForFunction("window.eagptViewer", { timeout: 60_000, polling: 100 });
      } catch (error) {
        throw new Error(`the page did not open: ${complaints.join("; ") || error.message}`);
      }
      return { page, complaints };
    });
  } finally {
    await browser.close();
    await rm(profile, { recursive: true, force: true });
  }
}
