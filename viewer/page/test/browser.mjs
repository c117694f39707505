// Browsers without a display, with a page of the viewer in them.
import { spawn } from "node:child_process";
import { existsSync } from "node:fs";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import puppeteer from "puppeteer-core";

const CHROMIUMS = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
const FIREFOXES = ["/usr/bin/firefox-esr", "/usr/bin/firefox"];
const SERVERS = ["/usr/bin/Xvfb"];

const first = (paths) => paths.find((path) => path && existsSync(path)) ?? null;

/** Path of a Chromium: CHROMIUM, or where systems keep it; `null` where there is none. */
export const findChromium = () => first([process.env.CHROMIUM, ...CHROMIUMS]);

/** Path of a Firefox: FIREFOX, or where systems keep it; `null` without it or without Xvfb. */
export const findFirefox = () => first(SERVERS) && first([process.env.FIREFOX, ...FIREFOXES]);

/** Runs `use(open)` with a Chromium; `open(url, size)` gives a page and the list of what its console complains of. */
export async function withBrowser(use) {
  const args = [
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
  ];
  return launched({ executablePath: findChromium(), args }, use);
}

/** The same with a Firefox, which has WebGL on a display alone: a virtual one. */
export async function withFirefox(use) {
  const server = spawn(first(SERVERS), ["-displayfd", "1", "-nolisten", "tcp"], { stdio: ["ignore", "pipe", "ignore"] });
  try {
    const display = await new Promise((resolve, reject) => {
      createInterface({ input: server.stdout }).once("line", resolve);
      server.once("exit", (code) => reject(new Error(`Xvfb has ended with ${code}`)));
    });
    const env = { ...process.env, DISPLAY: `:${display}`, LIBGL_ALWAYS_SOFTWARE: "1" };
    return await launched({ browser: "firefox", executablePath: findFirefox(), env }, use);
  } finally {
    server.kill();
  }
}

async function launched(options, use) {
  const profile = await mkdtemp(join(tmpdir(), "eagpt-viewer-"));
  const browser = await puppeteer.launch({ ...options, userDataDir: profile, protocolTimeout: 600_000 });
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
