// Keeps the canvas up to date: quick pictures while something moves, a whole one when it rests.

import type { Pinhole } from "./bins.ts";
import { Renderer, TILE, WINDOW_MOVING, WINDOW_STILL, type Look, type Picked } from "./renderer.ts";
import { discsOf, type Meta, type Scene } from "./scene.ts";
import type { BinReply, BinRequest } from "./worker.ts";
import workerText from "worker:text";

/** A camera for a picture of any size. */
export type CameraFor = (width: number, height: number) => Pinhole;

/** Time for a picture while something moves, milliseconds. */
const MOVING_MS = 60;
/** Rest after which the whole picture is drawn, milliseconds. */
const REST_MS = 120;
/** Longest time for a picture with several rays for a pixel, milliseconds. */
const PATIENCE_MS = 15_000;
/** Time for a band of the whole picture, milliseconds: the page stays responsive between. */
const BAND_MS = 40;

export interface Timing {
  binMs: number;
  traceMs: number;
  numEntries: number;
  numVisible: number;
  width: number;
  height: number;
}

export class Stage {
  camera: CameraFor;
  look: Look;
  /** Share of the width from which on the photograph is shown; 1 is none of it. */
  split = 1;
  timing: Timing = { binMs: 0, traceMs: 0, numEntries: 0, numVisible: 0, width: 0, height: 0 };
  /** Told whenever a picture is complete. */
  onPicture: () => void = () => {};
  /** Told whenever the camera may have moved. */
  onMove: () => void = () => {};
  readonly renderer: Renderer;
  private readonly worker: Worker;
  private readonly waiting = new Map<number, (reply: BinReply) => void>();
  private nextId = 1;
  private generation = 0;
  private busy = false;
  private moved = false;
  private movingScale = 0.5;
  private restTimer = 0;
  private antialias = 1;
  private numHolding = 0;
  private isDone = false;

  constructor(private readonly canvas: HTMLCanvasElement, private readonly meta: Meta, scene: Scene, camera: CameraFor, look: Look) {
    this.camera = camera;
    this.look = look;
    this.renderer = new Renderer(canvas, meta, scene);
    const url = URL.createObjectURL(new Blob([workerText], { type: "text/javascript" }));
    this.worker = new Worker(url);
    this.worker.onmessage = (event: MessageEvent<BinReply>) => {
      const reply = event.data;
      this.waiting.get(reply.id)?.(reply);
      this.waiting.delete(reply.id);
    };
    this.worker.onerror = (event) => {
      throw new Error(`worker: ${event.message}`);
    };
    this.worker.postMessage({ discs: discsOf(scene, meta.model) });
  }

  /** Shows another scene, or the same in another light, once no picture is under way. */
  async take(scene: Scene): Promise<void> {
    await this.alone(async () => {
      this.worker.postMessage({ discs: discsOf(scene, this.meta.model) });
      this.renderer.take(scene);
    });
  }

  /** Does something while no picture is drawn, and draws a new one then. */
  private async alone<T>(act: () => Promise<T>): Promise<T> {
    this.numHolding++;
    while (this.busy) await new Promise((resolve) => setTimeout(resolve, 5));
    this.busy = true;
    try {
      return await act();
    } finally {
      this.busy = false;
      this.numHolding--;
      this.move();
    }
  }

  private get held(): boolean {
    return this.numHolding > 0;
  }

  /** Lists of a camera become those of the renderer. */
  private async lists(camera: Pinhole): Promise<void> {
    const request: BinRequest = { id: this.nextId++, camera, tile: TILE };
    const reply = await new Promise<BinReply>((resolve) => {
      this.waiting.set(request.id, resolve);
      this.worker.postMessage(request);
    });
    this.renderer.setLists(camera, reply);
    const { milliseconds, entries, numVisible } = reply;
    const { width, height } = camera;
    this.timing = { ...this.timing, binMs: milliseconds, numEntries: entries.length, numVisible, width, height };
  }

  /** Size of the canvas on the display, device pixels. */
  private fullSize(): [number, number] {
    const { clientWidth, clientHeight } = this.canvas;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    return [Math.max(1, Math.round(clientWidth * ratio)), Math.max(1, Math.round(clientHeight * ratio))];
  }

  /** Whether the picture on the canvas is a whole one of the present camera. */
  isWhole(): boolean {
    return this.isDone;
  }

  /** The camera has moved: a quick picture, and a whole one once it rests. */
  move(): void {
    this.isDone = false;
    this.moved = true;
    this.onMove();
    this.generation++;
    window.clearTimeout(this.restTimer);
    if (!this.busy && !this.held) void this.quick();
  }

  private async quick(): Promise<void> {
    this.busy = true;
    while (this.moved && !this.held) {
      this.moved = false;
      const [width, height] = this.fullSize().map((size) => Math.max(16, Math.round(size * this.movingScale)));
      const camera = this.camera(width, height);
      await this.lists(camera);
      const started = performance.now();
      this.renderer.trace(this.look.layer, WINDOW_MOVING, 0, height);
      this.renderer.finish();
      const traceMs = performance.now() - started;
      this.timing.traceMs = traceMs;
      this.show(width, height, 1);
      const wanted = Math.sqrt(MOVING_MS / Math.max(1, traceMs + this.timing.binMs));
      this.movingScale = Math.min(1, Math.max(0.1, this.movingScale * Math.min(1.25, Math.max(0.6, wanted))));
      await new Promise(requestAnimationFrame);
    }
    this.busy = false;
    this.restTimer = window.setTimeout(() => void this.whole(), REST_MS);
  }

  private async whole(): Promise<void> {
    if (this.busy || this.held) return;
    this.busy = true;
    const generation = this.generation;
    const [width, height] = this.fullSize();
    const isCurrent = () => generation === this.generation && !this.held;
    const draw = async (antialias: number) => {
      const isComplete = await this.traceWhole(this.camera(width * antialias, height * antialias), isCurrent);
      if (isComplete) this.show(width, height, antialias);
      return isComplete;
    };
    let isComplete = await draw(1);
    // Four rays for a pixel take four times as long; small pixels need no more than one.
    const isSmooth = (window.devicePixelRatio || 1) >= 2 || 4 * this.timing.traceMs > PATIENCE_MS;
    if (isComplete && !isSmooth) isComplete = await draw(2);
    if (isComplete) {
      this.isDone = true;
      this.onPicture();
    }
    this.busy = false;
    if (this.moved && !this.held) void this.quick();
  }

  /** Band by band; whether it came to its end. */
  private async traceWhole(camera: Pinhole, isCurrent: () => boolean): Promise<boolean> {
    await this.lists(camera);
    let band = 2 * TILE;
    let traceMs = 0;
    for (let from = 0; from < camera.height; ) {
      if (!isCurrent()) return false;
      const to = Math.min(camera.height, from + band);
      const started = performance.now();
      this.renderer.trace(this.look.layer, WINDOW_STILL, from, to);
      this.renderer.finish();
      const took = performance.now() - started;
      traceMs += took;
      band = Math.max(TILE, Math.min(camera.height, Math.round((band * BAND_MS) / Math.max(1, took))));
      from = to;
      await new Promise((resolve) => setTimeout(resolve));
    }
    this.timing.traceMs = traceMs;
    return true;
  }

  private show(width: number, height: number, antialias: number): void {
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
    }
    this.antialias = antialias;
    this.display();
  }

  /** The picture once more, after a change of exposure, tone map or split. */
  display(): void {
    if (this.timing.width === 0) return;
    // While a whole picture is under way the last one is no longer there to be shown again.
    if (this.canvas.width * this.antialias !== this.timing.width) return;
    const split = this.split >= 1 ? 1e9 : this.split * this.canvas.width;
    this.renderer.display(this.look, this.antialias, split);
  }

  /** A picture of exactly this camera, as a data URI; nothing else is drawn meanwhile. */
  async picture(camera: CameraFor, width: number, height: number, antialias: number, look: Look): Promise<string> {
    return this.alone(async () => {
      const before = this.look;
      this.look = look;
      await this.traceWhole(camera(width * antialias, height * antialias), () => true);
      this.canvas.width = width;
      this.canvas.height = height;
      this.renderer.display(look, antialias, 1e9);
      this.look = before;
      return this.canvas.toDataURL("image/png");
    });
  }

  /** The disc under a point of the canvas, 0 to 1 from its top left corner. */
  async pick(x: number, y: number): Promise<Picked | null> {
    // The lists of a picture under way are those of another camera.
    while (this.busy || this.moved) await new Promise((resolve) => setTimeout(resolve, 5));
    return this.renderer.pick(x * this.timing.width, y * this.timing.height);
  }
}
