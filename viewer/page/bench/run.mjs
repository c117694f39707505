// The page beside the splat renderer Spark, in one Chromium and in turns: size, load, sorting, time
// of a frame, and PSNR against the program's 0-bounce. Times are those of the first of the views.
//
//   npm ci --prefix viewer/page && npm ci --prefix viewer/page/bench
//   node viewer/page/bench/run.mjs SCENE.ply DATASET VIEW[,VIEW…]
//
// No part of CI: times of software graphics are those of the machine and of what else it does. Its
// processors' time says less of the latter.
import { build } from "esbuild";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { mkdtemp, readFile, rm, stat } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { withBrowser } from "../test/browser.mjs";
import { decode, decodeUri, psnr } from "../test/psnr.mjs";
import { PROGRAM } from "../test/room.mjs";

const [scene, dataset, named] = process.argv.slice(2);
if (!named) throw new Error("usage: run.mjs SCENE.ply DATASET VIEW[,VIEW…]");
const views = named.split(",");
/** Pixels of a frame. */
const [WIDTH, HEIGHT] = [540, 360];
/** Frames of which the median counts; one before them compiles. */
const FRAMES = 5;

const eagpt = (...args) => execFileSync(PROGRAM, [...args, "--quiet"], { stdio: ["ignore", "ignore", "inherit"] });

/** The page: how its steps are taken, and a picture of a view. */
async function ours(open, folder) {
  const file = join(folder, "page.html");
  eagpt("export", scene, "--format", "html", "--dataset", dataset, "--views", named, "--no-lights", "--out", file);
  const { page } = await open(`file://${file}`, { width: WIDTH + 300, height: HEIGHT });
  const step = (kind) => (frame) =>
    page.evaluate(
      async (kind, name, width, height, frame) => {
        const { stage, meta, viewCamera } = window.eagptViewer;
        return stage.alone(async () => {
          // Each a little to the side of the one before, as while somebody walks.
          const camera = viewCamera(meta.views.find((one) => one.name === name), width, height);
          camera.eye[0] += 0.002 * frame;
          const listed = performance.now();
          await stage.lists(camera);
          const started = performance.now();
          if (kind === "sorted") return started - listed;
          stage.renderer.trace("radiance", kind === "moving" ? 8 : 16, 0, height);
          stage.renderer.finish();
          return performance.now() - started;
        });
      },
      kind, views[0], WIDTH, HEIGHT, frame,
    );
  return {
    title: "this page",
    page,
    bytes: (await stat(file)).size,
    loadMs: await page.evaluate(() => window.eagptViewer.timing().loadMs),
    steps: { sorted: step("sorted"), moving: step("moving"), still: step("still") },
    picture: (name, width, height) =>
      page.evaluate((...args) => window.eagptViewer.picture(...args), name, width, height, 2, {}),
  };
}

async function spark(open, folder) {
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
  server.unref();
  const { page } = await open(`http://127.0.0.1:${server.address().port}/`, { width: WIDTH, height: HEIGHT });
  const { frames, fy, h } = JSON.parse(await readFile(join(dataset, "transforms.json"), "utf8"));
  const fov = (2 * Math.atan((0.5 * h) / fy) * 180) / Math.PI;
  const cameraOf = (name) => ({ pose: frames.find((one) => one.file_name === name).transform_matrix.flat(), fov });
  const step = (kind) => (frame) =>
    page.evaluate((kind, ...args) => window.eagptViewer[kind](...args), kind, cameraOf(views[0]), WIDTH, HEIGHT, 0.002 * frame);
  return {
    title: "Spark",
    page,
    bytes: (await stat(file)).size,
    loadMs: await page.evaluate(() => window.eagptViewer.loadMs),
    steps: { sorted: step("sorted"), frame: step("frame") },
    picture: (name, width, height) =>
      page.evaluate((...args) => window.eagptViewer.picture(...args), cameraOf(name), width, height),
  };
}

/** Seconds of processors that the browser and all its processes have taken. */
async function processors(session) {
  const { processInfo } = await session.send("SystemInfo.getProcessInfo");
  return processInfo.reduce((sum, one) => sum + one.cpuTime, 0);
}

/** Times of all steps of all pages, in turns: what else the machine does meets them alike. */
async function times(pages) {
  const session = await pages[0].page.browser().target().createCDPSession();
  const found = new Map();
  for (let frame = 0; frame <= FRAMES; frame++) {
    for (const { title, page, steps } of pages) {
      await page.bringToFront();
      for (const [kind, take] of Object.entries(steps)) {
        const before = await processors(session);
        const ms = await take(frame);
        const key = `${title} ${kind}`;
        if (!found.has(key)) found.set(key, []);
        if (frame > 0) found.get(key).push({ ms, busyMs: 1000 * ((await processors(session)) - before) });
      }
    }
  }
  const median = (of, key) => of.map((one) => one[key]).sort((a, b) => a - b)[of.length >> 1];
  const round = (value) => Math.round(value).toLocaleString("en");
  return (title, kind) => {
    const of = found.get(`${title} ${kind}`);
    return `${kind} ${round(median(of, "ms"))} (${round(median(of, "busyMs"))})`;
  };
}

const folder = await mkdtemp(join(tmpdir(), "eagpt-viewer-bench-"));
try {
  eagpt("render", scene, "--cameras", dataset, "--mode", "0-bounce", "--views", named, "--out", join(folder, "render"));
  const references = views.map((name) => [name, decode(readFileSync(join(folder, "render", `${name}.png`)))]);
  await withBrowser(async (open) => {
    const pages = [await ours(open, folder), await spark(open, folder)];
    const time = await times(pages);
    const num = await pages[0].page.evaluate(() => window.eagptViewer.meta.num);
    console.log(`${num} Gaussians, ${WIDTH} × ${HEIGHT}, view ${views[0]}; medians of ${FRAMES}, ms (processors' ms)`);
    for (const { title, page, bytes, loadMs, steps, picture } of pages) {
      await page.bringToFront();
      const decibels = [];
      for (const [name, reference] of references) {
        const { width, height } = reference;
        decibels.push(`${name} ${psnr(decodeUri(await picture(name, width, height)), reference).toFixed(1)}`);
      }
      const kinds = Object.keys(steps).map((kind) => time(title, kind)).join(", ");
      console.log(`${title}: ${(bytes / 1e6).toFixed(1)} MB, loaded ${Math.round(loadMs)}, ${kinds}; ${decibels.join(", ")} dB`);
    }
  });
} finally {
  await rm(folder, { recursive: true, force: true });
}
