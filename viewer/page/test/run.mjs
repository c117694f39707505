// The page in a browser: its pictures against those of the program, and what people do with it.
// Prints `skipped: …` where there is no Chromium.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { findChromium, findFirefox, withBrowser, withFirefox } from "./browser.mjs";
import { control, edits, press } from "./edits.mjs";
import { decode, decodeUri, psnr } from "./psnr.mjs";
import { eagpt, makeLit, makeRoom, serve, VIEWS } from "./room.mjs";
import { training } from "./training.mjs";

/** dB that a picture of the page has at least against the program's. */
const LEAST_PSNR = 35;
/** Rays along each axis of a pixel, as `eagpt render` has unless told otherwise. */
const ANTIALIAS = 2;

if (!findChromium()) {
  console.log("skipped: tests of the viewer: no Chromium (CHROMIUM names one)");
  process.exit(0);
}

/** Waits until the page shows a script with a step. */
const hasStep = (page) =>
  page.waitForFunction(() => document.querySelector(".script").textContent.includes("[[step]]"), { polling: 100 });

const picture = (page, view, reference, look) =>
  page
    .evaluate(
      (...args) => window.eagptViewer.picture(...args),
      view, reference.width, reference.height, ANTIALIAS, look,
    )
    .then(decodeUri);

async function compare(page, title, reference, look, view, least = LEAST_PSNR) {
  const wanted = decode(reference);
  const value = psnr(await picture(page, view, wanted, look), wanted);
  console.log(`${title} ${view}: ${value.toFixed(2)} dB`);
  assert.ok(value >= least, `${title} ${view}: ${value.toFixed(2)} dB, less than ${least}`);
}

/** Pictures of a room as the program renders them, and that the comparison would notice. */
async function pictures(open, folder, degree) {
  const room = makeRoom(folder, degree);
  const { page, complaints } = await open(`file://${room.page}`);
  const reference = room.render(`renders-${degree}`, "--aov", "albedo,normal,emission");
  for (const view of VIEWS) await compare(page, `harmonics ${degree}`, reference(view), {}, view);
  const other = decode(reference(VIEWS[1]));
  const wrong = psnr(await picture(page, VIEWS[0], other, {}), other);
  assert.ok(wrong < LEAST_PSNR - 10, `another view has ${wrong} dB`);
  const timing = await page.evaluate(() => window.eagptViewer.timing());
  console.log(`harmonics ${degree}: loaded in ${Math.round(timing.loadMs)} ms`);
  if (degree === 0) await looks(page, room, reference);
  assert.deepEqual(complaints, []);
  await page.close();
  return room;
}

/** Tone maps, exposure and quantities. */
async function looks(page, room, reference) {
  const view = VIEWS[2];
  for (const toneMap of ["filmic", "aces", "reinhard", "agx"]) {
    const shown = room.render(`renders-${toneMap}`, "--tone-map", toneMap, "--exposure", "1.5");
    await compare(page, `${toneMap}, 1.5 stops`, shown(view), { toneMap, exposure: 1.5 }, view);
  }
  // The PNGs of the program show these with the same encodings.
  await compare(page, "albedo", reference(view, "albedo"), { layer: "albedo" }, view);
  await compare(page, "normal", reference(view, "normal"), { layer: "normal" }, view, 30);
  await compare(page, "emission", reference(view, "emission"), { layer: "emission" }, view);
}

/** Power and colour of lamps against the program's sum of their lights. */
async function lights(open, folder) {
  const lit = makeLit(folder);
  const { page, complaints } = await open(`file://${lit.page}`);
  const names = await page.evaluate(() => window.eagptViewer.meta.lights);
  const lamp = names.find((name) => name !== "rest");
  assert.ok(lamp, `no lamp among ${names}`);
  const view = VIEWS[1];
  const set = (change) => page.evaluate((...args) => window.eagptViewer.lights.set(...args), lamp, change);
  const cases = [
    ["as baked", {}, []],
    ["two stops up", { stops: 2 }, ["--set-light", `${lamp}=4`]],
    // Luminance 0.2126 of pure red becomes 1.
    ["red", { stops: 0, colour: "#ff0000" }, ["--set-light", `${lamp}=4.703669,0,0`]],
    ["off", { on: false }, ["--set-light", `${lamp}=0`]],
  ];
  const shown = [];
  for (const [title, change, options] of cases) {
    await set(change);
    const reference = lit.render(`lit-${title.replaceAll(" ", "-")}`, ...options)(view);
    await compare(page, `lamp ${lamp} ${title}`, reference, {}, view);
    shown.push(decode(reference));
  }
  for (const other of shown.slice(1)) assert.ok(psnr(shown[0], other) < 32, "the lamp does not show");
  assert.deepEqual(complaints, []);
  await page.close();
  return { lit, lamp };
}

/** A server: two pages, an edit script with undo and redo, a kill, and the program's replay. */
async function served(open, folder, { lit, lamp }) {
  let server = await serve(lit.scene, lit.dataset);
  const { page, complaints } = await open(server.url);
  const { page: other } = await open(server.url);
  const factors = (page) => page.evaluate(() => window.eagptViewer.factors());
  const agree = async (steps) => {
    const text = () => readFileSync(server.script, "utf8");
    for (const one of [page, other]) {
      await one.waitForFunction(
        (num) => document.querySelector(".script").textContent.split("[[step]]").length - 1 === num,
        { timeout: 10_000, polling: 100 },
        steps,
      );
      assert.equal(await one.$eval(".script", (script) => script.textContent), text());
    }
    assert.deepEqual(await factors(page), await factors(other));
    return text();
  };
  await control(page, `power of ${lamp}, stops`, 2);
  const first = await agree(1);
  assert.match(first, new RegExp(`"${lamp}" = \\[4.0, 4.0, 4.0\\]`));
  const bits = await factors(page);
  await control(other, `colour of ${lamp}`, "#ff8040");
  const second = await agree(2);
  await control(page, "rest is on", false).catch(() => control(page, `${lamp} is on`, false));
  await agree(3);
  await press(other, "undo");
  assert.equal(await agree(2), second);
  await press(page, "undo");
  assert.equal(await agree(1), first);
  assert.deepEqual(await factors(other), bits);
  await press(page, "redo");
  assert.equal(await agree(2), second);

  // The program makes of the script what the page shows.
  const edited = join(folder, "edited.ply");
  eagpt("edit", lit.scene, server.script, "--out", edited);
  const out = join(folder, "edited");
  // Pages in the background draw nothing.
  await page.bringToFront();
  eagpt("render", edited, "--cameras", lit.dataset, "--mode", "0-bounce", "--views", VIEWS[1], "--out", out);
  await compare(page, "edited by the script", readFileSync(join(out, `${VIEWS[1]}.png`)), {}, VIEWS[1]);
  const baked = join(folder, "edited-baked.ply");
  eagpt("bake", edited, "--cameras", lit.dataset, "--samples", "32", "--out", baked);
  const anew = join(folder, "edited-baked");
  eagpt("render", baked, "--cameras", lit.dataset, "--mode", "0-bounce", "--views", VIEWS[1], "--out", anew);
  await compare(page, "edited and baked anew", readFileSync(join(anew, `${VIEWS[1]}.png`)), {}, VIEWS[1]);
  await selects(page, lamp);

  assert.equal((await fetch(server.url.replace(/[0-9a-f]{32}/, "0".repeat(32)))).status, 403);
  await other.close();
  await server.end("SIGKILL");
  const killed = readFileSync(server.script, "utf8");
  server = await serve(lit.scene, lit.dataset);
  const { page: again } = await open(server.url);
  await hasStep(again);
  assert.equal(await again.$eval(".script", (script) => script.textContent), killed);
  await again.close();
  assert.equal(await server.end("SIGINT"), 0);
  // Only the server that was killed is missed.
  assert.deepEqual(complaints.filter((text) => !/ERR_|Failed to load resource/.test(text)), []);
  await page.close();
}

/** A press on a lamp selects it in the panel. */
async function selects(page, lamp) {
  const place = await page.evaluate(async (name) => {
    const viewer = window.eagptViewer;
    const lamp = viewer.meta.lamps.find((one) => one.name === name);
    viewer.goTo(viewer.meta.views.find((one) => lamp.views.includes(one.name)).name);
    while (!viewer.isWhole()) await new Promise((resolve) => setTimeout(resolve, 20));
    return viewer.placeOf(lamp.centre);
  }, lamp);
  const box = await (await page.$("#canvas")).boundingBox();
  await page.mouse.click(box.x + place[0] * box.width, box.y + place[1] * box.height);
  await page.waitForFunction(() => document.querySelector('.lamp button[aria-pressed="true"]'), { timeout: 10_000, polling: 100 });
  const marked = await page.$eval('.lamp button[aria-pressed="true"]', (one) => one.parentElement.textContent);
  assert.ok(marked.startsWith(lamp), marked);
}

/** Keys, drags, views, comparison: the picture follows, and the console stays empty. */
async function actions(open, address, size) {
  const { page, complaints } = await open(address, size);
  const eye = () => page.evaluate(() => [...window.eagptViewer.walker.eye, ...window.eagptViewer.walker.forward()]);
  const rested = () => page.waitForFunction(() => window.eagptViewer.isWhole(), { timeout: 60_000, polling: 100 });
  await rested();
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  assert.ok(wide <= size.width, `the page is ${wide} pixels wide at ${size.width}`);
  const before = await eye();
  await page.focus("#canvas");
  await page.keyboard.down("KeyW");
  const [x, y, z] = before;
  await page.waitForFunction((...from) => from.some((value, k) => window.eagptViewer.walker.eye[k] !== value), { timeout: 20_000, polling: 50 }, x, y, z);
  await page.keyboard.up("KeyW");
  const walked = await eye();
  assert.notDeepEqual(walked.slice(0, 3), before.slice(0, 3));
  assert.deepEqual(walked.slice(3), before.slice(3));
  const box = await (await page.$("#canvas")).boundingBox();
  const drag = async (dx, dy) => {
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2 + dx, box.y + box.height / 2 + dy, { steps: 3 });
    await page.mouse.up();
  };
  await drag(60, 10);
  const turned = await eye();
  assert.deepEqual(turned.slice(0, 3), walked.slice(0, 3));
  assert.notDeepEqual(turned.slice(3), walked.slice(3));
  // Numbers of a fixed sequence choose what is done.
  let state = 7;
  const next = (num) => (state = (state * 48271) % 2147483647) % num;
  // Pictures take their time, and files are saved where nobody looks.
  const controls = () =>
    page.evaluateHandle(() => {
      const all = document.querySelectorAll("#panel button, #panel input, #panel select");
      return [...all].filter((one) => !one.disabled && !/path-trace|^save$/.test(one.textContent));
    });
  for (let i = 0; i < 100; i++) {
    const kind = next(4);
    if (kind === 0) await page.keyboard.press(["KeyA", "KeyE", "ArrowLeft", "ArrowUp", "KeyD"][next(5)]);
    else if (kind === 1) await drag(next(80) - 40, next(40) - 20);
    else if (kind === 2) await page.mouse.wheel({ deltaY: next(2) * 200 - 100 });
    else await page.evaluate((all, place) => {
      // Tools change what there is.
      const one = all[place % all.length];
      one.focus();
      if (one.type === "range") {
        one.valueAsNumber = Number(one.min) + 0.4 * (one.max - one.min);
        one.dispatchEvent(new Event("input", { bubbles: true }));
      } else if (one.tagName === "SELECT") {
        one.selectedIndex = (one.selectedIndex + 1) % one.options.length;
        one.dispatchEvent(new Event("change", { bubbles: true }));
      } else one.click();
    }, await controls(), next(1000));
  }
  await rested();
  assert.equal(await page.$eval("#status", (one) => one.className), "");
  // Steps that cannot be done are refused with 422, and browsers write that down.
  assert.deepEqual(complaints.filter((text) => !/status of (422|404)/.test(text)), []);
  await page.close();
}

/** The same on a page that is edited, whose script has a step to start with. */
async function liveActions(open, folder, { lit, lamp }) {
  const options = ["--samples", "2", "--script", join(folder, "random.toml")];
  const server = await serve(lit.scene, lit.dataset, ...options);
  try {
    const { page } = await open(server.url);
    await control(page, `power of ${lamp}, stops`, 1);
    await hasStep(page);
    await page.close();
    await actions(open, server.url, { width: 1280, height: 760 });
    const num = readFileSync(server.script, "utf8").split("[[step]]").length - 1;
    console.log(`100 actions, a script of ${num} steps`);
    if (num > 0) eagpt("edit", lit.scene, server.script, "--out", join(folder, "random.ply"));
  } finally {
    await server.end("SIGKILL");
  }
}

/** At a dataset's camera the photograph is on the right of the slider, the scene on the left. */
async function comparison(open, room) {
  const { page, complaints } = await open(`file://${room.page}`);
  const halves = await page.evaluate(async () => window.eagptViewer.comparisonShares());
  // Far from equal where they are not the same picture, near where they show the same room.
  assert.ok(halves.photographDiffers > 0.002 && halves.photographDiffers < 0.15, JSON.stringify(halves));
  assert.ok(halves.sceneDiffers < 1e-6, JSON.stringify(halves));
  assert.deepEqual(complaints, []);
  await page.close();
}

/** A picture of the page in another browser. */
async function elsewhere(open, room) {
  const { page, complaints } = await open(`file://${room.page}`);
  await compare(page, "Firefox", room.render("renders-firefox")(VIEWS[1]), {}, VIEWS[1]);
  assert.deepEqual(complaints, []);
  await page.close();
}

const folder = await mkdtemp(join(tmpdir(), "eagpt-viewer-room-"));
try {
  await withBrowser(async (open) => {
    const room = await pictures(open, folder, 0);
    const varied = await pictures(open, folder, 2);
    if (findFirefox()) await withFirefox((open) => elsewhere(open, varied));
    else console.log("skipped: the page in Firefox: no Firefox (FIREFOX names one), or no Xvfb");
    const found = await lights(open, folder);
    await served(open, folder, found);
    await edits(open, folder, { ...found, compare });
    await training(open, folder, compare);
    await comparison(open, room);
    for (const width of [1280, 390]) await actions(open, `file://${room.page}`, { width, height: 760 });
    await liveActions(open, folder, found);
  });
  console.log("the viewer's tests have passed");
} finally {
  await rm(folder, { recursive: true, force: true });
}
