// The start of the page.

import { byId, Page, status } from "./page.ts";
import { Probe } from "./probe.ts";
import { unpack, type Meta } from "./scene.ts";

function fail(error: unknown): void {
  status.className = "error";
  status.setAttribute("role", "alert");
  status.textContent = error instanceof Error ? error.message : String(error);
}

async function main(): Promise<void> {
  const started = performance.now();
  const meta = JSON.parse(byId("meta").textContent!) as Meta;
  const scene = await unpack(meta, byId("data").textContent!.trim());
  const page = new Page(meta, scene, performance.now() - started);
  Object.assign(window, { eagptViewer: new Probe(page) });
}

window.addEventListener("error", (event) => fail(event.error ?? event.message));
window.addEventListener("unhandledrejection", (event) => fail(event.reason));
void main().catch((error) => {
  fail(error);
  throw error;
});
