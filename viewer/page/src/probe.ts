// Questions of tests and measurements to a page, as `window.eagptViewer`.

import { viewCamera } from "./camera.ts";
import { project } from "./overlay.ts";
import type { Page } from "./page.ts";
import type { Look } from "./renderer.ts";
import type { ViewInfo } from "./scene.ts";

export class Probe {
  readonly meta;
  readonly walker;
  readonly stage;
  readonly lights;
  readonly tools;
  readonly path;
  readonly stills;
  readonly viewCamera = viewCamera;

  constructor(private readonly page: Page) {
    ({
      meta: this.meta,
      walker: this.walker,
      stage: this.stage,
      lights: this.lights,
      tools: this.tools,
      path: this.path,
      stills: this.stills,
    } = page);
  }

  private view(name: string): ViewInfo {
    const view = this.meta.views.find((one) => one.name === name);
    if (!view) throw new Error(`view: no \`${name}\``);
    return view;
  }

  goTo(name: string): void {
    this.page.jump(this.view(name));
  }

  /** A picture of a view, as `eagpt render` makes it. */
  async picture(name: string, width: number, height: number, antialias: number, look: Partial<Look>): Promise<string> {
    const view = this.view(name);
    const whole: Look = { ...this.page.look, ...look };
    // Lights that were just set come with the next frame.
    await new Promise(requestAnimationFrame);
    return this.stage.picture((w, h) => viewCamera(view, w, h), width, height, antialias, whole);
  }

  /** Factors of the lights. */
  factors(): number[][] {
    return this.lights.shownFactors();
  }

  /** Where the present camera sees a point, 0 to 1 from the top left corner. */
  placeOf(point: number[]): number[] {
    const { clientWidth, clientHeight } = this.page.canvas;
    const [x, y] = project(this.stage.camera(clientWidth, clientHeight), point) ?? [NaN, NaN];
    return [x / clientWidth, y / clientHeight];
  }

  /** Whether the scene of the server is the one that is shown. */
  follows(): boolean {
    return this.page.follower.isThere();
  }

  /** A number that other Gaussians would not have. */
  bits(): string {
    const { positions, radiances, albedos, axesU, axesV, opacities, emissions } = this.page.scene;
    const columns = [positions, radiances, albedos, axesU, axesV, opacities, emissions];
    const hash = (sum: number, word: number) => Math.imul(sum ^ word, 16777619);
    return columns.map((column) => new Uint32Array(column.buffer).reduce(hash, -2128831035)).join(" ");
  }

  /** Whether the picture is complete. */
  isWhole(): boolean {
    return this.stage.isWhole();
  }

  /** Mean differences of either half of a compared view to the scene alone, 0 to 1. */
  async comparisonShares() {
    this.page.jump(this.meta.views.find((one) => one.photograph)!);
    const rested = async () => {
      while (!this.stage.isWhole()) await new Promise((resolve) => setTimeout(resolve, 20));
    };
    const pixels = () => {
      const { gl } = this.stage.renderer;
      const { width, height } = this.page.canvas;
      const bytes = new Uint8Array(4 * width * height);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
      gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
      return { width, bytes };
    };
    await this.page.compare(true);
    await rested();
    const both = pixels();
    this.stage.split = 1;
    this.stage.display();
    const alone = pixels();
    const sums = [0, 0];
    both.bytes.forEach((value, i) => {
      const half = (i >> 2) % both.width < both.width / 2 ? 0 : 1;
      sums[half] += Math.abs(value - alone.bytes[i]) / 255;
    });
    const [sceneDiffers, photographDiffers] = sums.map((sum) => sum / (both.bytes.length / 2));
    return { sceneDiffers, photographDiffers };
  }

  timing() {
    return { loadMs: this.page.loadMs, ...this.stage.timing };
  }
}
