// Camera paths as `eagpt render --camera-path` reads them: the camera_path.json of nerfstudio.

import { add, dot, scaled, unit, type Vec } from "./camera.ts";
import type { Pinhole } from "./bins.ts";
import { button, element, section, slider } from "./panel.ts";

/** Frames for a second. */
const FPS = 24;

/** A camera of a path: where it is, where it looks, its vertical field of view in radians. */
interface Key {
  eye: Vec;
  forward: Vec;
  fov: number;
}

/** The file of these cameras, for frames of a size. */
export function pathFile(cameras: Pinhole[], width: number, height: number) {
  const frame = (camera: Pinhole) => {
    // OpenGL's axes: x right, y up, z back.
    const [x, y, z] = [camera.right, scaled(camera.down, -1), scaled(camera.forward, -1)];
    const rows = [0, 1, 2].flatMap((k) => [x[k], y[k], z[k], camera.eye[k]]);
    const fov = (2 * Math.atan((0.5 * camera.height) / camera.fy) * 180) / Math.PI;
    return { camera_to_world: [...rows, 0, 0, 0, 1], fov, aspect: width / height };
  };
  return {
    camera_type: "perspective",
    render_width: width,
    render_height: height,
    fps: FPS,
    seconds: cameras.length / FPS,
    camera_path: cameras.map(frame),
  };
}

/** Through all keys at a pace of `seconds`, along a curve of Catmull and Rom. */
function between(keys: Key[], seconds: number): Key[] {
  const num = Math.max(2, Math.round(seconds * FPS));
  const at = (i: number) => keys[Math.max(0, Math.min(keys.length - 1, i))];
  return Array.from({ length: num }, (_, frame) => {
    const time = (frame / (num - 1)) * (keys.length - 1);
    const i = Math.min(keys.length - 2, Math.floor(time));
    const t = time - i;
    const weights = [
      0.5 * (-t + 2 * t * t - t ** 3),
      0.5 * (2 - 5 * t * t + 3 * t ** 3),
      0.5 * (t + 4 * t * t - 3 * t ** 3),
      0.5 * (-t * t + t ** 3),
    ];
    const four = [at(i - 1), at(i), at(i + 1), at(i + 2)];
    const sum = (of: (key: Key) => number[]) =>
      four.reduce<Vec>((all, key, k) => add(all, of(key), weights[k]), [0, 0, 0]);
    // Keys that look opposite ways have no direction half way.
    const forward = sum((key) => key.forward);
    const length = Math.hypot(...forward);
    const fov = four.reduce((all, key, k) => all + weights[k] * key.fov, 0);
    return { eye: sum((key) => key.eye), forward: length > 1e-3 ? unit(forward) : at(i).forward, fov };
  });
}

export class PathRecorder {
  private keys: Key[] = [];
  /** Every frame of a walk. */
  private walk: Key[] = [];
  private timer = 0;
  private readonly told = element("p", { role: "status" });
  private readonly record = button("record", () => this.toggle());
  private readonly save = button("save", () => this.download());
  private readonly seconds = slider("seconds", { min: 1, max: 60, step: 1 }, 5, () => this.tell());

  /** `camera` is the present one for a picture of some size; `upright` one that looks some way. */
  constructor(
    private readonly camera: (width: number, height: number) => Pinhole,
    private readonly upright: (key: Key, width: number, height: number) => Pinhole,
    private readonly size: () => [number, number],
  ) {
    this.record.setAttribute("aria-pressed", "false");
    this.tell();
  }

  part(): HTMLElement {
    const add = button("add this view", () => this.add());
    const clear = button("clear", () => this.clear());
    const made = section(
      "Camera path",
      element("div", { class: "row" }, add, this.record, clear, this.save),
      this.seconds.label,
      this.told,
    );
    made.open = false;
    return made;
  }

  private now(): Key {
    const [width, height] = this.size();
    const camera = this.camera(width, height);
    const fov = 2 * Math.atan((0.5 * camera.height) / camera.fy);
    return { eye: [...camera.eye] as Vec, forward: [...camera.forward] as Vec, fov };
  }

  add(): void {
    this.walk = [];
    const key = this.now();
    const last = this.keys.at(-1);
    // The same view twice is a stop that nobody asked for.
    if (last && Math.hypot(...add(key.eye, last.eye, -1)) === 0 && dot(key.forward, last.forward) > 1 - 1e-9) return;
    this.keys.push(key);
    this.tell();
  }

  private clear(): void {
    this.keys = [];
    this.walk = [];
    this.tell();
  }

  private toggle(): void {
    const on = this.record.getAttribute("aria-pressed") !== "true";
    this.record.setAttribute("aria-pressed", `${on}`);
    window.clearInterval(this.timer);
    if (on) {
      this.clear();
      this.timer = window.setInterval(() => {
        this.walk.push(this.now());
        this.tell();
      }, 1000 / FPS);
    }
  }

  private tell(): void {
    const { keys, walk } = this;
    this.save.disabled = keys.length < 2 && walk.length < 2;
    if (walk.length > 0) this.told.textContent = `${walk.length} frames, ${(walk.length / FPS).toFixed(1)} s`;
    else this.told.textContent = `${keys.length} views; eagpt render --camera-path reads the saved file`;
  }

  /** The content of the file. */
  file() {
    const [width, height] = this.size();
    const keys = this.walk.length > 0 ? this.walk : between(this.keys, this.seconds.input.valueAsNumber);
    return pathFile(keys.map((key) => this.upright(key, width, height)), width, height);
  }

  private download(): void {
    const blob = new Blob([JSON.stringify(this.file(), null, 1)], { type: "application/json" });
    const url = URL.createObjectURL(blob);
    const link = element("a", { href: url, download: "camera_path.json" });
    link.click();
    window.setTimeout(() => URL.revokeObjectURL(url), 10_000);
  }
}
