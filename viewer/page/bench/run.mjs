// The page beside the splat renderer Spark, in one Chromium: size, load, sorting, time of a frame,
// and PSNR against the program's 0-bounce.
//
//   npm ci --prefix viewer/page && npm ci --prefix viewer/page/bench
//   node viewer/page/bench/run.mjs SCENE.ply DATASET VIEW
//
// No part of CI: times of software graphics are those of the machine and of what else it does.
import { build } from "esbuild";
import { execFileSync } from "node:child_process";
import { createServer } from "node:http";
import { mkdtemp, readFile, rm, stat } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { withBrowser } from "../test/browser.mjs";
import { decode, decodeUri, psnr } from "../test/psnr.mjs";
import { PROGRAM } from "../test/room.mjs";

const [scene, dataset, view] = process.argv.slice(2);
if (!view) throw new Error("usage: run.mjs SCENE.ply DATASET VIEW");
/** Pixels of a frame. */
const [WIDTH, HEIGHT] = [540, 360];
/** Frames of which the median counts. */
const FRAMES = 5;

const eagpt = (...args) => execFileSync(PROGRAM, [...args, "--quiet"], { stdio: ["ignore", "ignore", "inherit"] });
const round = (value) => Math.round(value).toLocaleString("en");

async function ours(open, folder, reference) {
  const file = join(folder, "page.html");
  eagpt("export", scene, "--format", "html", "--dataset", dataset, "--views", view, "--no-lights", "--out", file);
  const { page } = await open(`file://${file}`, { width: WIDTH + 300, height: HEIGHT });
  const { width, height } = reference;
  const picture = await page.evaluate((...args) => window.eagptViewer.picture(...args), view, width, height, 2, {});
  const measured = await page.evaluate(
    async (name, width, height, frames) => {
      const { stage, meta, timing } = window.eagptViewer;
      const loadMs = window.eagptViewer.timing().loadMs;
      const found = meta.views.find((one) => one.name === name);
      window.eagptViewer.goTo(name);
      return stage.alone(async () => {
        const times = [];
        for (let i = 0; i <= frames; i++) {
          // Each a little to the side of the one before, as while somebody walks.
          const camera = window.eagptViewer.viewCamera(found, width, height);
          camera.eye[0] += 0.002 * i;
          await stage.lists(camera);
          const started = performance.now();
          stage.renderer.trace("radiance", 8, 0, height);
          stage.renderer.finish();
          const moving = performance.now() - started;
          stage.renderer.trace("radiance", 16, 0, height);
          stage.renderer.finish();
          times.push({ sorted: stage.timing.binMs, moving, still: performance.now() - started - moving });
        }
        // The first one compiles.
        return { loadMs, num: meta.num, times: times.slice(1) };
      });
    },
    view, WIDTH, HEIGHT, FRAMES,
  );
  await page.close();
  return { ...measured, bytes: (await stat(file)).size, psnr: psnr(decodeUri(picture), reference) };
}

async function spark(open, folder, reference) {
  const file = join(folder, "3dgs.ply");
  eagpt("export", scene, "--format", "3dgs", "--out", file);
  const script = await build({
    entryPoints: [new URL("spark-page.mjs", import.meta.url).pathname],
    bundle: true,
    write: false,
    format: "esm",
    target: "es2022",
  });
  const html = `<!doctype html><canvas id="canvas"></canvas><script type="module" src="page.js"></script>`;
  const places = { "/": ["text/html", html], "/page.js": ["text/javascript", script.outputFiles[0].text], "/scene.ply": ["application/octet-stream", await readFile(file)] };
  const server = createServer((request, response) => {
    const [kind, body] = places[request.url] ?? ["text/plain", ""];
    response.writeHead(body ? 200 : 404, { "Content-Type": kind }).end(body);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  try {
    const { page } = await open(`http://127.0.0.1:${server.address().port}/`, { width: WIDTH, height: HEIGHT });
    const { frames, fy, h } = JSON.parse(await readFile(join(dataset, "transforms.json"), "utf8"));
    const frame = frames.find((one) => one.file_name === view);
    const fov = (2 * Math.atan((0.5 * h) / fy) * 180) / Math.PI;
    const camera = { pose: frame.transform_matrix.flat(), fov };
    const measured = await page.evaluate((...args) => window.eagptViewer.measure(...args), camera, WIDTH, HEIGHT, FRAMES);
    const { width, height } = reference;
    const picture = await page.evaluate((...args) => window.eagptViewer.picture(...args), camera, width, height);
    await page.close();
    return { ...measured, bytes: (await stat(file)).size, psnr: psnr(decodeUri(picture), reference) };
  } finally {
    server.close();
  }
}

const median = (times, key) => times.map((one) => one[key]).sort((a, b) => a - b)[times.length >> 1];

const folder = await mkdtemp(join(tmpdir(), "eagpt-viewer-bench-"));
try {
  eagpt("render", scene, "--cameras", dataset, "--mode", "0-bounce", "--views", view, "--out", join(folder, "render"));
  const reference = decode(await readFile(join(folder, "render", `${view}.png`)));
  await withBrowser(async (open) => {
    const rows = [["this page", await ours(open, folder, reference)], ["Spark", await spark(open, folder, reference)]];
    console.log(`${rows[0][1].num} Gaussians, view ${view}, ${WIDTH} × ${HEIGHT}; medians of ${FRAMES}, milliseconds`);
    for (const [name, { bytes, loadMs, times, psnr }] of rows) {
      const part = (key) => (key in times[0] ? `${key} ${round(median(times, key))}` : "");
      const kinds = ["sorted", "moving", "still", "frame"].map(part).filter(Boolean).join(", ");
      console.log(`${name}: ${(bytes / 1e6).toFixed(1)} MB, loaded ${round(loadMs)}, ${kinds}; ${psnr.toFixed(1)} dB`);
    }
  });
} finally {
  await rm(folder, { recursive: true, force: true });
}
