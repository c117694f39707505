// A room of the virtual rig, trained in seconds: scenes to show, and what the program renders.
import { execFileSync, spawn } from "node:child_process";
import { existsSync, readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { join } from "node:path";
import { createInterface } from "node:readline";

/** The program: EAGPT, or the debug build of this workspace. */
export const PROGRAM =
  process.env.EAGPT ?? fileURLToPath(new URL("../../../target/debug/eagpt", import.meta.url));

/** Test views. */
export const VIEWS = ["p000", "p001", "p003", "p004", "p006", "p008"];

export function eagpt(...args) {
  if (!existsSync(PROGRAM)) throw new Error(`${PROGRAM}: is not there: cargo build`);
  execFileSync(PROGRAM, [...args, "--quiet"], { stdio: ["ignore", "ignore", "inherit"] });
}

/** The room with light that differs with the direction, of `degree`; 0 is without. */
export function makeRoom(folder, degree) {
  const room = join(folder, "room");
  const dataset = join(room, "truth/all");
  if (!existsSync(room)) {
    eagpt("synth", "bedroom", "--parts", "truth", "--size", "96x64", "--views", "10", "--spp", "4", "--out", room);
  }
  const run = join(folder, `run-${degree}`);
  const options = ["--stage", "radiance", "--preset", "draft", "--iterations", "300", "--gaussians", "8000"];
  eagpt("train", dataset, ...options, "--set", `radiance.harmonics.degree=${degree}`, "--out", run);
  const scene = join(run, "scene.ply");
  const page = join(folder, `room-${degree}.html`);
  eagpt("export", scene, "--format", "html", "--dataset", dataset, "--out", page);
  return { scene, dataset, page, render: (name, ...more) => render(folder, name, scene, dataset, more) };
}

/** The room baked with the light of each lamp. */
export function makeLit(folder) {
  const dataset = join(folder, "room/truth/all");
  const run = join(folder, "run-lit");
  // The preset whole: a cruder scene leaks, and its lamps hardly light the room.
  eagpt("train", dataset, "--preset", "draft", "--out", run);
  const scene = join(run, "lit.ply");
  eagpt("bake", join(run, "scene.ply"), "--cameras", dataset, "--per-light", "--samples", "32", "--out", scene);
  const page = join(folder, "lit.html");
  // lamps.json and lit.lights stand beside the scene.
  eagpt("export", scene, "--format", "html", "--dataset", dataset, "--out", page);
  return { scene, dataset, page, render: (name, ...more) => render(folder, name, scene, dataset, more) };
}

/** `eagpt view` of a scene: its address, once it listens, and how to end it. */
export const serve = (scene, dataset, ...more) => listening("view", scene, "--dataset", dataset, ...more);

/** A command that serves a page: what it says of that once it listens, and how to end it. */
export async function listening(...args) {
  const child = spawn(PROGRAM, [...args, "--json"], { stdio: ["ignore", "pipe", "inherit"] });
  const { url, script } = await new Promise((resolve, reject) => {
    // To its end: a command whose messages nobody reads would fail.
    createInterface({ input: child.stdout }).on("line", (line) => {
      const told = JSON.parse(line);
      if (told.message === "listening") resolve(told);
    });
    child.once("exit", (code) => reject(new Error(`eagpt ${args[0]} ended with ${code}`)));
  });
  const ended = () =>
    new Promise((resolve) => {
      if (child.exitCode !== null || child.signalCode !== null) resolve(child.exitCode);
      else child.removeAllListeners("exit").once("exit", (code) => resolve(code));
    });
  const end = (signal) => {
    const code = ended();
    child.kill(signal);
    return code;
  };
  return { url, script, ended, end };
}

function render(folder, name, scene, dataset, more) {
  const out = join(folder, name);
  eagpt("render", scene, "--cameras", dataset, "--mode", "0-bounce", "--views", VIEWS.join(","), "--out", out, ...more);
  return (view, aov = ".") => readFileSync(join(out, aov, `${view}.png`));
}
