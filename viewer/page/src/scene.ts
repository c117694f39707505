// The scene as the program has packed it (viewer/src/pack.rs describes the columns), unpacked.

import type { Discs } from "./bins.ts";

export interface ViewInfo {
  name: string;
  width: number;
  height: number;
  fx: number;
  fy: number;
  cx: number;
  cy: number;
  /** Rows of world from camera, OpenCV axes: 3 × 4. */
  pose: number[];
  /** Photograph as a data URI, light x stored as x / (1 + x) in sRGB; absent where none is. */
  photograph?: string;
}

export interface LampInfo {
  name: string;
  shape: string;
  radiance: number[];
  power: number[];
}

/** Numbers that are needed to unpack a scene. */
export interface SceneMeta {
  num: number;
  harmonics: boolean;
  position: { low: number[]; step: number[] };
  scale: { low: number; step: number };
  opacity: { step: number };
  radiance: { low: number; step: number };
  albedo: { max: number };
  harmonic: { step: number };
  bounds: number[][];
  /** Lights whose light alone is packed: names of lamps, or "rest". */
  lights: string[];
}

export interface Meta extends SceneMeta {
  title: string;
  model: Record<string, number>;
  toneMaps: { name: string; curve: number[] | null }[];
  display: { exposure: number; toneMap: string };
  up: number[];
  views: ViewInfo[];
  lamps: LampInfo[];
  /** Where the page is: in a file, at a server that keeps an edit, at one of a training. */
  kind: "file" | "edit" | "training";
}

/** Columns, one value or vector for each Gaussian. */
export interface Scene {
  num: number;
  /** Step of the codes of harmonics; 0 where radiance is the same in all directions. */
  harmonicStep: number;
  positions: Float32Array;
  /** Tangents over scales: dot products with offsets are u and v. */
  axesU: Float32Array;
  axesV: Float32Array;
  opacities: Float32Array;
  radiances: Float32Array;
  albedos: Float32Array;
  /** Largest albedo that a byte can be. */
  maxAlbedo: number;
  emissions: Float32Array;
  /** Number of the lamp, from 1; 0 is none. */
  lamps: Uint8Array;
  /** Codes of the coefficients, `[24 n]`; empty where radiance is the same in all directions. */
  harmonics: Int16Array;
  /** Radiances by each light alone, `[3 n]` each. */
  lights: Float32Array[];
}

/** Bytes of base64. */
export function bytesOf(text: string): Uint8Array<ArrayBuffer> {
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function inflate(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array> {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

class Columns {
  private at = 0;

  constructor(private readonly bytes: Uint8Array, private readonly num: number) {}

  plane(): Uint8Array {
    const end = this.at + this.num;
    if (end > this.bytes.length) throw new Error("the packed scene is truncated");
    const plane = this.bytes.subarray(this.at, end);
    this.at = end;
    return plane;
  }

  /** 16 bits in two planes, low bytes first. */
  words(): Uint16Array {
    const [low, high] = [this.plane(), this.plane()];
    const words = new Uint16Array(this.num);
    for (let i = 0; i < words.length; i++) words[i] = low[i] | (high[i] << 8);
    return words;
  }

  /** Words that are stored as differences to the one before. */
  runningWords(): Uint16Array {
    const words = this.words();
    for (let i = 1; i < words.length; i++) words[i] += words[i - 1];
    return words;
  }

  /** Signed words: 0, −1, 1, −2, … */
  signedWords(): Int16Array {
    const codes = this.words();
    const words = new Int16Array(codes.buffer);
    for (let i = 0; i < words.length; i++) words[i] = (codes[i] >>> 1) ^ -(codes[i] & 1);
    return words;
  }

  end(): void {
    if (this.at !== this.bytes.length) throw new Error("the packed scene is longer than it says");
  }
}

/** Values of codes. Loops: `from` of typed arrays takes many times as long. */
function floats(codes: ArrayLike<number>, value: (code: number) => number): Float32Array {
  const made = new Float32Array(codes.length);
  for (let i = 0; i < made.length; i++) made[i] = value(codes[i]);
  return made;
}

export async function unpack(meta: SceneMeta, base64: string): Promise<Scene> {
  const num = meta.num;
  const columns = new Columns(await inflate(bytesOf(base64)), num);
  const vectors = () => new Float32Array(3 * num);
  const scene: Scene = {
    num,
    harmonicStep: meta.harmonics ? meta.harmonic.step : 0,
    positions: vectors(),
    axesU: vectors(),
    axesV: vectors(),
    opacities: new Float32Array(num),
    radiances: new Float32Array(0),
    albedos: vectors(),
    maxAlbedo: meta.albedo.max,
    emissions: new Float32Array(num),
    lamps: new Uint8Array(num),
    harmonics: new Int16Array(meta.harmonics ? 24 * num : 0),
    lights: [],
  };
  for (let axis = 0; axis < 3; axis++) {
    const codes = columns.runningWords();
    const { low, step } = meta.position;
    for (let i = 0; i < num; i++) scene.positions[3 * i + axis] = low[axis] + step[axis] * codes[i];
  }
  const scales = [columns.words(), columns.words()].map((codes) =>
    floats(codes, (code) => 2 ** (meta.scale.low + meta.scale.step * code)),
  );
  unpackRotations(columns, scene, scales);
  scene.opacities = floats(columns.words(), (code) => code * meta.opacity.step);
  scene.radiances = unpackRadiances(columns, num, meta.radiance);
  scene.emissions = floats(columns.plane(), (code) => code / 255);
  for (let channel = 0; channel < 3; channel++) {
    const codes = columns.plane();
    for (let i = 0; i < num; i++) scene.albedos[3 * i + channel] = meta.albedo.max * (codes[i] / 255) ** 2;
  }
  scene.lamps = columns.plane().slice();
  for (let k = 0; k < (meta.harmonics ? 24 : 0); k++) {
    const codes = columns.signedWords();
    for (let i = 0; i < num; i++) scene.harmonics[24 * i + k] = codes[i];
  }
  scene.lights = meta.lights.map(() => unpackRadiances(columns, num, meta.radiance));
  columns.end();
  return scene;
}

/** Three components of 12 bits; the fourth, the largest, follows from unit length. */
function unpackRotations(columns: Columns, scene: Scene, [su, sv]: Float32Array[]): void {
  const low = [columns.plane(), columns.plane(), columns.plane()];
  const [high01, high2] = [columns.plane(), columns.plane()];
  const q = [0, 0, 0, 0];
  for (let i = 0; i < scene.num; i++) {
    const high = [high01[i] & 15, high01[i] >> 4, high2[i] & 15];
    const largest = high2[i] >> 4;
    let rest = 1;
    for (let k = 0, c = 0; k < 4; k++) {
      if (k === largest) continue;
      q[k] = ((low[c][i] | (high[c] << 8)) / 4095 - 0.5) * Math.SQRT2;
      rest -= q[k] * q[k];
      c++;
    }
    q[largest] = Math.sqrt(Math.max(0, rest));
    const [w, x, y, z] = q;
    const at = 3 * i;
    scene.axesU[at] = (1 - 2 * (y * y + z * z)) / su[i];
    scene.axesU[at + 1] = (2 * (x * y + w * z)) / su[i];
    scene.axesU[at + 2] = (2 * (x * z - w * y)) / su[i];
    scene.axesV[at] = (2 * (x * y - w * z)) / sv[i];
    scene.axesV[at + 1] = (1 - 2 * (x * x + z * z)) / sv[i];
    scene.axesV[at + 2] = (2 * (y * z + w * x)) / sv[i];
  }
}

/** Logarithms; red and blue as differences to green. Code 0 is no light. */
function unpackRadiances(columns: Columns, num: number, how: { low: number; step: number }): Float32Array {
  const green = columns.words();
  const value = (code: number) => (code <= 0 ? 0 : 2 ** (how.low + how.step * (code - 1)));
  const [red, blue] = [columns.signedWords(), columns.signedWords()];
  const radiances = new Float32Array(3 * num);
  for (let i = 0; i < num; i++) {
    radiances[3 * i] = value(green[i] + red[i]);
    radiances[3 * i + 1] = value(green[i]);
    radiances[3 * i + 2] = value(green[i] + blue[i]);
  }
  return radiances;
}

/** Radiances with every light at its factor, `[r, g, b]`, of that alone. */
export function mixed(scene: Scene, factors: number[][]): Float32Array {
  const sum = new Float32Array(3 * scene.num);
  scene.lights.forEach((light, k) => {
    const factor = factors[k];
    for (let i = 0; i < sum.length; i++) sum[i] += factor[i % 3] * light[i];
  });
  return sum;
}

/** The discs that a camera's rays may hit. */
export function discsOf(scene: Scene, model: Record<string, number>): Discs {
  const extents = (axes: Float32Array) => {
    const out = new Float32Array(axes.length);
    for (let i = 0; i < scene.num; i++) {
      const { MAX_RADIUS, MIN_ALPHA } = model;
      const cut2 = 2 * Math.log(scene.opacities[i] / MIN_ALPHA);
      const radius = Math.min(MAX_RADIUS, Math.sqrt(Math.max(0, cut2)));
      const [x, y, z] = axes.subarray(3 * i, 3 * i + 3);
      const by = radius / (x * x + y * y + z * z);
      out[3 * i] = x * by;
      out[3 * i + 1] = y * by;
      out[3 * i + 2] = z * by;
    }
    return out;
  };
  return {
    positions: scene.positions.slice(),
    extentsU: extents(scene.axesU),
    extentsV: extents(scene.axesV),
  };
}
