// Draws a scene on a canvas: prepare, trace, display.

import type { Pinhole } from "./bins.ts";
import { add, scaled, unit, type Vec } from "./camera.ts";
import { framebuffer, Pass, Texture, type Gl } from "./gl.ts";
import type { Meta, Scene } from "./scene.ts";
import { DISPLAY, LAYERS, prepareShader, ROW, traceShader, type Layer } from "./shaders.ts";
import type { BinReply } from "./worker.ts";

/** Hits that wait to be put in order, while the camera rests and while it moves. */
export const WINDOW_STILL = 16;
export const WINDOW_MOVING = 8;
/** Edge of a tile, pixels: of 8, up to twice as many tests of discs miss; lists are three times as long. */
export const TILE = 4;

export interface Look {
  layer: Layer;
  /** Stops. */
  exposure: number;
  toneMap: string;
}

export interface Picked {
  disc: number;
  /** Along the ray, scene units. */
  distance: number;
  /** In the world. */
  point: Vec;
}

/** Direction of the ray through a point (x, y) of the picture: `base + x stepX + y stepY`. */
function raysOf(camera: Pinhole) {
  const stepX = scaled(camera.right, 1 / camera.fx);
  const stepY = scaled(camera.down, 1 / camera.fy);
  return { base: add(add(camera.forward, stepX, -camera.cx), stepY, -camera.cy), stepX, stepY };
}

export class Renderer {
  readonly gl: Gl;
  /** Lamp that is shown marked, from 1; 0 is none. */
  highlighted = 0;
  private readonly still: { positions: Texture; axesU: Texture; axesV: Texture; albedos: Texture; radiances: Texture; harmonics: Texture };
  private readonly seen: Texture[];
  private prepared: WebGLFramebuffer | null = null;
  private readonly starts: Texture;
  private readonly entries: Texture;
  private readonly picture: Texture;
  private readonly photograph: Texture;
  private readonly pickTexture: Texture;
  private readonly preparePass: Pass;
  private readonly displayPass: Pass;
  private readonly tracePasses = new Map<string, Pass>();
  private pictureTarget: WebGLFramebuffer | null = null;
  private albedoBytes = new Uint8Array(0);
  private preparedFor = "";
  private lists: { camera: Pinhole } | null = null;

  constructor(readonly canvas: HTMLCanvasElement, private readonly meta: Meta, private scene: Scene) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser has no WebGL2");
    if (!gl.getExtension("EXT_color_buffer_float")) {
      throw new Error("this browser cannot draw to textures of floats (EXT_color_buffer_float)");
    }
    this.gl = gl;
    const texture = (format: ConstructorParameters<typeof Texture>[1]) => new Texture(gl, format);
    this.still = {
      positions: texture("rgba32f"),
      axesU: texture("rgba32f"),
      axesV: texture("rgba32f"),
      albedos: texture("rgba8"),
      radiances: texture("rgba32f"),
      harmonics: texture("rgba16i"),
    };
    this.seen = [0, 1, 2, 3].map(() => texture("rgba32f"));
    this.take(scene);
    this.starts = texture("r32ui");
    this.entries = texture("r32ui");
    this.picture = texture("rgba16f");
    this.photograph = texture("rgba8");
    this.photograph.resize(1, 1);
    this.pickTexture = texture("rgba32f");
    this.pickTexture.resize(1, 1);
    this.preparePass = new Pass(gl, "prepare", prepareShader(meta.model));
    this.displayPass = new Pass(gl, "display", DISPLAY);
    gl.bindVertexArray(gl.createVertexArray());
    gl.disable(gl.DITHER);
  }

  /** Takes another scene; there is no picture of it before new lists. */
  take(scene: Scene): void {
    this.scene = scene;
    this.lists = null;
    this.upload();
    const rows = Math.max(1, Math.ceil(scene.num / ROW));
    if (this.prepared && this.seen[0].height === rows) return;
    this.seen.forEach((one) => one.resize(ROW, rows));
    if (this.prepared) this.gl.deleteFramebuffer(this.prepared);
    this.prepared = framebuffer(this.gl, this.seen);
  }

  private upload(): void {
    const { scene, still } = this;
    const four = (vectors: Float32Array, last: ArrayLike<number> | null) => {
      const out = new Float32Array(4 * scene.num);
      for (let i = 0; i < scene.num; i++) {
        for (let k = 0; k < 3; k++) out[4 * i + k] = vectors[3 * i + k];
        out[4 * i + 3] = last ? last[i] : 0;
      }
      return out;
    };
    still.positions.list(four(scene.positions, scene.opacities), 4);
    still.axesU.list(four(scene.axesU, scene.emissions), 4);
    still.axesV.list(four(scene.axesV, scene.lamps), 4);
    const albedos = four(scene.albedos, null);
    this.albedoBytes = new Uint8Array(albedos.length);
    for (let i = 0; i < albedos.length; i++) this.albedoBytes[i] = Math.round(255 * Math.sqrt(albedos[i] / scene.maxAlbedo));
    still.albedos.list(this.albedoBytes, 4);
    still.harmonics.list(scene.harmonics.length > 0 ? scene.harmonics : new Int16Array(4), 4);
    this.setRadiances(scene.radiances);
  }

  /** Marks Gaussians, a bit for each, low bits first; `null` is none of them. */
  select(bits: Uint8Array | null): void {
    const bytes = this.albedoBytes;
    for (let i = 0; i < this.scene.num; i++) {
      bytes[4 * i + 3] = bits && (bits[i >> 3] >> (i & 7)) & 1 ? 255 : 0;
    }
    this.still.albedos.list(bytes, 4);
    this.preparedFor = "";
  }

  /** Other light of the same Gaussians, `[3 n]`. */
  setRadiances(radiances: Float32Array): void {
    const { num } = this.scene;
    const four = new Float32Array(4 * num);
    for (let i = 0; i < num; i++) four.set(radiances.subarray(3 * i, 3 * i + 3), 4 * i);
    this.still.radiances.list(four, 4);
    this.preparedFor = "";
  }

  /** Takes the lists of a camera, in whose pixels the next pictures are traced. */
  setLists(camera: Pinhole, reply: BinReply): void {
    this.starts.list(reply.starts, 1);
    this.entries.list(reply.entries, 1);
    this.lists = { camera };
  }

  setPhotograph(image: ImageBitmap | null): void {
    if (!image) return;
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.photograph.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, image);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
  }

  private prepare(layer: Layer, eye: number[]): void {
    const key = [layer, this.highlighted, ...eye].join(" ");
    if (key === this.preparedFor) return;
    const { gl, preparePass: pass, still, scene } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.prepared);
    gl.viewport(0, 0, this.seen[0].width, this.seen[0].height);
    gl.disable(gl.SCISSOR_TEST);
    pass.use();
    pass.textures({
      positions: still.positions.texture,
      axesU: still.axesU.texture,
      axesV: still.axesV.texture,
      radiances: still.radiances.texture,
      albedos: still.albedos.texture,
      harmonics: still.harmonics.texture,
    });
    pass.int("hasHarmonics", scene.harmonicStep > 0 ? 1 : 0);
    pass.float("harmonicStep", scene.harmonicStep);
    pass.float("maxAlbedo", scene.maxAlbedo);
    pass.int("layer", LAYERS.indexOf(layer));
    pass.int("num", scene.num);
    pass.int("highlighted", this.highlighted);
    pass.vec3("eye", eye);
    pass.draw();
    this.preparedFor = key;
  }

  private tracePass(window: number, pick: boolean): Pass {
    const key = `${window} ${pick}`;
    let pass = this.tracePasses.get(key);
    if (!pass) {
      pass = new Pass(this.gl, "trace", traceShader(this.meta.model, window, pick));
      this.tracePasses.set(key, pass);
    }
    return pass;
  }

  private bindTrace(camera: Pinhole, window: number, pick: boolean): Pass {
    const pass = this.tracePass(window, pick);
    const [seenU, seenV, seenPlane, seenShown] = this.seen.map((one) => one.texture);
    const { base, stepX, stepY } = raysOf(camera);
    pass.use();
    pass.textures({ seenU, seenV, seenPlane, seenShown, starts: this.starts.texture, entries: this.entries.texture });
    pass.vec3("base", base);
    pass.vec3("stepX", stepX);
    pass.vec3("stepY", stepY);
    pass.int("tile", TILE);
    pass.int("tilesX", Math.ceil(camera.width / TILE));
    return pass;
  }

  /** Traces rows `from` to `to` of the camera of the lists. */
  trace(layer: Layer, window: number, from: number, to: number): void {
    const { gl } = this;
    if (!this.lists) throw new Error("nothing is traced before there are lists");
    const { camera } = this.lists;
    this.prepare(layer, camera.eye);
    if (this.picture.width !== camera.width || this.picture.height !== camera.height || !this.pictureTarget) {
      this.picture.resize(camera.width, camera.height);
      if (this.pictureTarget) gl.deleteFramebuffer(this.pictureTarget);
      this.pictureTarget = framebuffer(gl, [this.picture]);
    }
    const pass = this.bindTrace(camera, window, false);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.pictureTarget);
    gl.viewport(0, 0, camera.width, camera.height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, from, camera.width, to - from);
    pass.draw();
    gl.disable(gl.SCISSOR_TEST);
  }

  /** The disc that shows most at a pixel of the camera of the lists; `null` where none is. */
  pick(x: number, y: number): Picked | null {
    const { gl } = this;
    if (!this.lists) return null;
    const { camera } = this.lists;
    this.prepare("radiance", camera.eye);
    const target = framebuffer(gl, [this.pickTexture]);
    const pass = this.bindTrace(camera, WINDOW_STILL, true);
    gl.viewport(0, 0, 1, 1);
    pass.vec2("pickAt", [Math.floor(x) + 0.5, Math.floor(y) + 0.5]);
    pass.draw();
    const found = new Float32Array(4);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.FLOAT, found);
    gl.deleteFramebuffer(target);
    if (found[0] < 0) return null;
    const [disc, distance] = found;
    const { base, stepX, stepY } = raysOf(camera);
    const direction = add(add(base, stepX, Math.floor(x) + 0.5), stepY, Math.floor(y) + 0.5);
    return { disc, distance, point: add(camera.eye, unit(direction), distance) };
  }

  /** Shows the picture on the canvas, `antialias` × `antialias` traced pixels in each. */
  display(look: Look, antialias: number, split: number): void {
    const { gl, displayPass: pass, canvas } = this;
    const tone = this.meta.toneMaps.find((one) => one.name === look.toneMap);
    if (!tone) throw new Error(`tone map: no \`${look.toneMap}\``);
    const kinds: Record<string, number> = { srgb: 0, reinhard: 2, agx: 3 };
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    pass.use();
    pass.textures({ picture: this.picture.texture, photograph: this.photograph.texture });
    pass.ivec2("size", [canvas.width, canvas.height]);
    pass.int("antialias", antialias);
    pass.int("layer", LAYERS.indexOf(look.layer));
    pass.int("toneMap", kinds[tone.name] ?? 1);
    const curve = tone.curve ?? [0, 0, 0, 0, 0, 0];
    pass.vec3("curveA", curve.slice(0, 3));
    pass.vec3("curveB", curve.slice(3));
    pass.float("exposure", look.exposure);
    pass.float("split", split);
    pass.draw();
  }

  /** Waits until the device has done what it was told: the read needs it. */
  finish(): void {
    const { gl } = this;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.pictureTarget);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.FLOAT, new Float32Array(4));
  }
}
