// A training that is watched: scenes and curves arrive, and the last scene is that of the result.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { eagpt, listening, VIEWS } from "./room.mjs";

export async function training(open, folder, compare) {
  const [dataset, run] = [join(folder, "room/truth/all"), join(folder, "run-watched")];
  const options = ["--stage", "radiance", "--preset", "draft", "--iterations", "600", "--gaussians", "8000"];
  const server = await listening("train", dataset, ...options, "--out", run, "--view");
  try {
    const { page, complaints } = await open(server.url);
    const first = await page.evaluate(() => window.eagptViewer.bits());
    await page.waitForFunction(() => document.querySelector(".curve polyline"), { timeout: 60_000, polling: 100 });
    await page.waitForFunction(
      () => document.querySelector("#panel").textContent.includes("The training has ended."),
      { timeout: 600_000, polling: 100 },
    );
    await page.waitForFunction(() => window.eagptViewer.follows(), { timeout: 60_000, polling: 50 });
    assert.notEqual(await page.evaluate(() => window.eagptViewer.bits()), first);
    assert.equal(await server.ended(), 0);
    const captions = await page.$$eval(".curve figcaption", (all) => all.map((one) => one.textContent));
    assert.match(captions.join(), /^radiance: iteration 600 of 600, loss 0\.\d+$/);
    const buttons = await page.$$eval("#panel button", (all) => all.map((one) => one.textContent));
    assert.ok(!buttons.includes("undo") && !buttons.includes("insert") && buttons.includes("measure"), `${buttons}`);
    const out = join(folder, "watched");
    eagpt("render", join(run, "scene.ply"), "--cameras", dataset, "--mode", "0-bounce", "--views", VIEWS[1], "--out", out);
    await compare(page, "watched training", readFileSync(join(out, `${VIEWS[1]}.png`)), {}, VIEWS[1]);
    // A scene may be another one by the time that it is asked for; browsers write that down.
    assert.deepEqual(complaints.filter((text) => !/status of 404/.test(text)), []);
    await page.close();
  } finally {
    await server.end("SIGKILL");
  }
}
