// Edits of a page that a server shows: what the page selects, inserts and renders against what the
// program makes of the saved script.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { decode } from "./psnr.mjs";
import { eagpt, PROGRAM, serve, VIEWS } from "./room.mjs";

/** Directions of the server's bakes: few are enough to compare them. */
const SAMPLES = ["--samples", "16"];

export const press = (page, title, within = "#panel") =>
  page.evaluate(
    (title, within) => {
      const buttons = [...document.querySelectorAll(`${within} button`)];
      const found = buttons.find((one) => one.textContent === title);
      if (!found) throw new Error(`no button ${title} among ${buttons.map((one) => one.textContent)}`);
      found.click();
    },
    title, within,
  );

/** Sets a control by its name for screen readers. */
export const control = (page, label, value) =>
  page.$eval(
    `[aria-label="${label}"]`,
    (input, value) => {
      if (input.type === "checkbox") input.checked = value;
      else input.value = value;
      for (const name of ["input", "change"]) input.dispatchEvent(new Event(name, { bubbles: true }));
    },
    value,
  );

const rested = (page) => page.waitForFunction(() => window.eagptViewer.isWhole(), { timeout: 60_000, polling: 100 });

/** Waits until the script has so many steps and the light fits. */
async function baked(page, steps) {
  await page.waitForFunction(
    (steps) =>
      document.querySelector(".script").textContent.split("[[step]]").length - 1 === steps &&
      document.querySelector(".light").textContent === "" &&
      window.eagptViewer.follows(),
    { timeout: 120_000, polling: 100 },
    steps,
  );
  await rested(page);
}

/** Presses the picture where it shows a point of the world. */
async function pressAt(page, point) {
  await rested(page);
  const place = await page.evaluate((point) => window.eagptViewer.placeOf(point), point);
  const box = await (await page.$("#canvas")).boundingBox();
  await page.mouse.click(box.x + place[0] * box.width, box.y + place[1] * box.height);
}

const selected = async (page) => {
  await page.waitForFunction(() => window.eagptViewer.tools.selected?.num > 0, { timeout: 20_000, polling: 50 });
  await rested(page);
  return page.evaluate(() => {
    const { selector, selected } = window.eagptViewer.tools;
    return { selector, num: selected.num };
  });
};

/** Gaussians that the program's dry run selects with a selector after the steps of a script. */
function selects(folder, scene, script, selector) {
  const toml = (value) =>
    Array.isArray(value)
      ? `[${value.map(toml).join(", ")}]`
      : typeof value === "object"
        ? `{ ${Object.entries(value).map(([key, one]) => `${key} = ${toml(one)}`).join(", ")} }`
        : JSON.stringify(value);
  const path = join(folder, "dry.toml");
  writeFileSync(path, `${readFileSync(script, "utf8")}\n[[step]]\nselect = ${toml(selector)}\nthen = ["lights_off"]\n`);
  const told = execFileSync(PROGRAM, ["edit", scene, path, "--dry-run", "--json"], { encoding: "utf8" });
  return told.trim().split("\n").map((line) => JSON.parse(line)).filter((one) => one.message === "step").at(-1).num_selected;
}

export async function edits(open, folder, found) {
  const script = join(folder, "edits.toml");
  const server = await serve(found.lit.scene, found.lit.dataset, ...SAMPLES, "--script", script);
  try {
    await edited(open, folder, server, found);
  } finally {
    await server.end("SIGKILL");
  }
}

async function edited(open, folder, server, { lit, lamp, compare }) {
  const { page, complaints } = await open(server.url);
  const packed = () => page.evaluate(() => window.eagptViewer.bits());
  const text = () => readFileSync(server.script, "utf8");
  const view = VIEWS[1];
  await page.evaluate((name) => window.eagptViewer.goTo(name), view);
  const untouched = await packed();

  // A lamp is inserted half way to what the view shows in its middle.
  await press(page, "insert");
  await page.select("select[aria-label='what']", "ball lamp");
  await rested(page);
  const centre = await page.evaluate(async () => {
    const { point } = await window.eagptViewer.stage.pick(0.5, 0.5);
    return point.map((value, k) => 0.5 * (value + window.eagptViewer.walker.eye[k]));
  });
  for (const [k, name] of ["x", "y", "z"].entries()) await control(page, name, centre[k]);
  await control(page, "width", 0.3);
  await page.evaluate(() => [...document.querySelectorAll("#panel button")].findLast((one) => one.textContent === "insert").click());
  await baked(page, 1);
  const inserted = await packed();
  assert.notEqual(inserted, untouched);

  // A press on it selects what hangs together, which is what the program selects.
  await press(page, "select");
  await pressAt(page, centre);
  const ball = await selected(page);
  assert.ok(ball.num > 10, `${ball.num} Gaussians`);
  assert.equal(selects(folder, lit.scene, server.script, ball.selector), ball.num);
  for (const [k, name] of ["by x", "by y", "by z"].entries()) await control(page, name, [0, 0, -0.2][k]);
  await press(page, "duplicate");
  await baked(page, 2);
  const doubled = await packed();

  // The lamp of the room, by name.
  await page.evaluate((name) => {
    const viewer = window.eagptViewer;
    const found = viewer.meta.lamps.find((one) => one.name === name);
    viewer.goTo(found.views.find((one) => viewer.meta.views.some((view) => view.name === one)));
  }, lamp);
  await pressAt(page, await page.evaluate((name) => window.eagptViewer.meta.lamps.find((one) => one.name === name).centre, lamp));
  const own = await selected(page);
  assert.deepEqual(own.selector, { lamp });
  assert.equal(selects(folder, lit.scene, server.script, own.selector), own.num);
  await press(page, "clear");

  // Things at the side of the view: as far as it hangs together.
  await page.evaluate((name) => window.eagptViewer.goTo(name), view);
  await rested(page);
  await pressAt(page, await page.evaluate(async () => (await window.eagptViewer.stage.pick(0.25, 0.7)).point));
  const thing = await selected(page);
  assert.ok(thing.selector.cluster && thing.num > 10, JSON.stringify(thing));
  assert.equal(selects(folder, lit.scene, server.script, thing.selector), thing.num);
  await press(page, "clear");

  // A box around the first ball, and its discs go.
  await press(page, "box");
  for (const [k, name] of ["x", "y", "z"].entries()) await control(page, name, centre[k]);
  for (const name of ["width", "depth", "height"]) await control(page, name, 0.31);
  await page.evaluate(() => [...document.querySelectorAll("#panel button")].findLast((one) => one.textContent === "select").click());
  const boxed = await selected(page);
  assert.ok(boxed.num >= ball.num, `${boxed.num} in the box, ${ball.num} of the ball`);
  assert.equal(selects(folder, lit.scene, server.script, boxed.selector), boxed.num);
  await press(page, "delete");
  await baked(page, 3);
  await control(page, `${lamp} is on`, false);
  await baked(page, 4);

  // The picture is that of the program's edit and bake of the saved script, to the bit of both.
  const [changed, bakedScene] = ["edits.ply", "edits-baked.ply"].map((name) => join(folder, name));
  eagpt("edit", lit.scene, server.script, "--lamps", join(dirname(lit.scene), "lamps.json"), "--out", changed);
  eagpt("bake", changed, "--cameras", lit.dataset, ...SAMPLES, "--out", bakedScene);
  const out = join(folder, "edits-rendered");
  eagpt("render", bakedScene, "--cameras", lit.dataset, "--mode", "0-bounce", "--views", view, "--out", out);
  await compare(page, "edited and baked", readFileSync(join(out, `${view}.png`)), {}, view);

  await still(page, folder, changed, lit);
  await cameraPath(page, folder, changed, lit);

  // Undo brings back the bits.
  const last = text();
  for (const [bits, steps] of [[null, 3], [doubled, 2], [inserted, 1], [untouched, 0]]) {
    await press(page, "undo");
    await baked(page, steps);
    if (bits) assert.equal(await packed(), bits);
  }
  for (let steps = 1; steps <= 4; steps++) {
    await press(page, "redo");
    await page.waitForFunction(
      (steps) => document.querySelector(".script").textContent.split("[[step]]").length - 1 === steps,
      { polling: 50 }, steps,
    );
  }
  assert.equal(text(), last);
  // A bake is under way, or about to be: an act ends it, and so does a kill, which loses nothing.
  await server.end("SIGKILL");
  assert.equal(text(), last);
  assert.deepEqual(complaints.filter((text) => !/ERR_|Failed to load resource/.test(text)), []);
  await page.close();
}

/** A path-traced still, against the program's rendering of the camera beside it. */
async function still(page, folder, edited, lit) {
  // Few pixels, which are traced soon.
  const size = page.viewport();
  await page.setViewport({ width: 96, height: 90 });
  await page.select("select[aria-label='samples']", "16");
  await press(page, "path-trace this view");
  await page.waitForFunction(() => document.querySelector("dialog.still").open, { timeout: 120_000, polling: 100 });
  await page.waitForFunction(() => document.querySelector("dialog.still img").naturalWidth > 0, { timeout: 10_000, polling: 100 });
  const file = await page.evaluate(() => window.eagptViewer.stills.files()[0]);
  const out = join(folder, "still");
  const path = file.replace(/png$/, "json");
  eagpt("render", edited, "--cameras", lit.dataset, "--mode", "path", "--spp", "16", "--camera-path", path, "--out", out);
  const [ours, theirs] = [file, join(out, "frame_0000.png")].map((name) => readFileSync(name));
  assert.deepEqual(decode(ours).data, decode(theirs).data);
  await press(page, "close", "dialog.still");
  await page.setViewport(size);
}

/** The file of a recorded path is one that the program renders. */
async function cameraPath(page, folder, edited, lit) {
  for (const name of [VIEWS[1], VIEWS[2]]) {
    await page.evaluate((name) => window.eagptViewer.goTo(name), name);
    await page.evaluate(() => window.eagptViewer.path.add());
  }
  const file = await page.evaluate(() => window.eagptViewer.path.file());
  assert.equal(file.camera_path.length, 120);
  file.camera_path = [file.camera_path[0], file.camera_path[60], file.camera_path[119]];
  [file.render_width, file.render_height] = [48, 30];
  const path = join(folder, "camera_path.json");
  writeFileSync(path, JSON.stringify(file));
  const out = join(folder, "flight");
  eagpt("render", edited, "--cameras", lit.dataset, "--mode", "0-bounce", "--camera-path", path, "--out", out);
  const frames = [0, 1, 2].map((i) => readFileSync(join(out, `frame_000${i}.png`)));
  assert.notDeepEqual(frames[0], frames[1]);
  const { frames: poses } = JSON.parse(readFileSync(join(out, "transforms.json"), "utf8"));
  const dataset = JSON.parse(readFileSync(join(lit.dataset, "transforms.json"), "utf8")).frames;
  const wanted = dataset.find((frame) => frame.file_name === VIEWS[1]).transform_matrix.flat();
  poses[0].transform_matrix.flat().forEach((value, k) => assert.ok(Math.abs(value - wanted[k]) < 1e-4, `${value} ${wanted[k]}`));
}
