// The page: a scene to walk through.

import { viewCamera, Walker, unit, type Vec } from "./camera.ts";
import { Controls, type Mode } from "./controls.ts";
import { Follower } from "./follow.ts";
import { Live, type EditState } from "./live.ts";
import { Lights } from "./lights.ts";
import { Overlay } from "./overlay.ts";
import { PathRecorder } from "./path.ts";
import { button, checkbox, choice, element, section, select, slider } from "./panel.ts";
import type { Look, Picked } from "./renderer.ts";
import type { Meta, Scene, ViewInfo } from "./scene.ts";
import { LAYERS, type Layer } from "./shaders.ts";
import { Stage } from "./stage.ts";
import { Stills } from "./stills.ts";
import { Tools } from "./tools.ts";
import { Training } from "./training.ts";

export const byId = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;
export const status = byId("status");

/** A photograph of the page, decoded. */
async function photograph(view: ViewInfo): Promise<ImageBitmap | null> {
  if (!view.photograph) return null;
  const image = new Image();
  image.src = view.photograph;
  await image.decode();
  // No conversion of colour: the bytes are codes of light.
  return createImageBitmap(image, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
}

export class Page {
  readonly canvas = byId<HTMLCanvasElement>("canvas");
  readonly walker: Walker;
  readonly stage: Stage;
  readonly look: Look;
  readonly lights: Lights;
  private readonly live: Live | null;
  readonly stills: Stills | null;
  readonly tools: Tools;
  readonly path: PathRecorder;
  readonly follower: Follower;
  private view: ViewInfo | null = null;
  private comparing = false;
  private readonly compareSlider = slider("photograph", { min: 0, max: 1, step: 0.01 }, 0.5, (value) => {
    this.stage.split = value;
    this.stage.display();
  });
  private readonly compareBox = checkbox("compare with the photograph", (on) => void this.compare(on));

  constructor(readonly meta: Meta, public scene: Scene, readonly loadMs: number) {
    this.look = { layer: "radiance", exposure: meta.display.exposure, toneMap: meta.display.toneMap };
    const [low, high] = meta.bounds;
    const middle = low.map((value, k) => 0.5 * (value + high[k])) as Vec;
    const size = Math.hypot(...low.map((value, k) => high[k] - value));
    this.walker = new Walker(unit(meta.up), middle);
    this.stage = new Stage(this.canvas, meta, scene, (w, h) => this.walker.camera(w, h), this.look);
    this.stage.onPicture = () => this.tell();
    const shown = (radiances: Float32Array) => {
      this.stage.renderer.setRadiances(radiances);
      this.stage.move();
    };
    const marked = (lamp: number) => {
      this.stage.renderer.highlighted = lamp;
      this.stage.move();
    };
    this.lights = new Lights(meta, scene, shown, marked);
    const overlay = new Overlay(this.canvas, (w, h) => this.stage.camera(w, h));
    this.stage.onMove = () => overlay.draw();
    this.follower = new Follower(scene, (next, id) => this.take(next, id), (problem) => this.status(problem));
    const follow = (state: EditState) => {
      this.lights.follow(state.factors);
      this.stills?.follow(state);
      this.follower.follow(state.scene);
    };
    this.live = meta.kind === "edit" ? new Live(follow, (problem) => this.status(problem)) : null;
    this.tools = new Tools(meta, scene, this.stage, overlay, this.live, (picked) => this.looked(picked));
    const pixels = (): [number, number] => [this.canvas.clientWidth, this.canvas.clientHeight];
    const camera = (w: number, h: number) => this.stage.camera(w, h);
    this.stills = this.live && new Stills(this.live, camera, pixels, () => this.look);
    const upright = ({ eye, forward, fov }: { eye: Vec; forward: Vec; fov: number }, w: number, h: number) => {
      const walker = new Walker(unit(meta.up), eye);
      walker.fov = fov;
      walker.lookAlong(forward);
      return walker.camera(w, h);
    };
    this.path = new PathRecorder(camera, upright, pixels);
    const controls = new Controls(this.canvas, this.walker, 0.12 * size, {
      moved: () => this.walked(),
      clicked: (x, y) => void this.clicked(x, y),
      paints: () => this.tools.paints,
      painted: (x, y, isLast) => void this.painted(x, y, isLast),
    });
    this.fillPanel(controls);
    new ResizeObserver(() => this.layOut()).observe(byId("stage"));
    if (meta.views.length > 0) this.jump(meta.views[0]);
    else this.stage.move();
  }

  private tell(): void {
    const { binMs, traceMs, width, height } = this.stage.timing;
    const num = this.scene.num.toLocaleString("en");
    status.textContent =
      `${num} Gaussians · loaded in ${Math.round(this.loadMs)} ms · sorted in ${Math.round(binMs)} ms · ` +
      `${width} × ${height} rays in ${Math.round(traceMs)} ms`;
  }

  /** The canvas has the shape of the photograph it is compared with, else that of the window. */
  private layOut(): void {
    const { style } = this.canvas;
    if (this.comparing && this.view) {
      const { clientWidth, clientHeight } = byId("stage");
      const by = Math.min(clientWidth / this.view.width, clientHeight / this.view.height);
      style.width = `${Math.round(this.view.width * by)}px`;
      style.height = `${Math.round(this.view.height * by)}px`;
    } else {
      style.width = style.height = "";
    }
    this.stage.move();
  }

  jump(view: ViewInfo): void {
    this.view = view;
    this.walker.take(viewCamera(view, view.width, view.height));
    this.stage.camera = (width, height) => viewCamera(view, width, height);
    const has = view.photograph !== undefined;
    this.compareBox.input.disabled = !has;
    if (this.comparing) void this.compare(has);
    else this.layOut();
  }

  private walked(): void {
    this.stage.camera = (width, height) => this.walker.camera(width, height);
    if (this.comparing) void this.compare(false);
    this.stage.move();
  }

  async compare(on: boolean): Promise<void> {
    this.comparing = on && this.view !== null;
    this.compareBox.input.checked = this.comparing;
    this.compareSlider.input.disabled = !this.comparing;
    if (this.comparing && this.view) {
      const view = this.view;
      this.stage.camera = (width, height) => viewCamera(view, width, height);
      this.stage.renderer.setPhotograph(await photograph(view));
      this.stage.split = this.compareSlider.input.valueAsNumber;
    } else {
      this.stage.split = 1;
    }
    this.layOut();
  }

  private async clicked(x: number, y: number): Promise<void> {
    const picked = await this.stage.pick(x, y);
    if (picked) this.tools.pressed(picked);
  }

  private async painted(x: number, y: number, isLast: boolean): Promise<void> {
    const picked = await this.stage.pick(x, y);
    if (picked) this.tools.paint(picked, isLast);
  }

  /** Shows a scene that the server has made, in place of the one before. */
  private async take(scene: Scene, id: number): Promise<void> {
    await this.stage.take(scene);
    this.scene = scene;
    this.tools.take(scene, id);
    this.lights.take(scene);
  }

  private looked(picked: Picked): void {
    const lamp = this.scene.lamps[picked.disc];
    const what = lamp > 0 ? `lamp ${this.meta.lamps[lamp - 1].name}` : "a surface";
    this.status(`${what}, ${picked.distance.toFixed(3)} units away`);
    if (lamp > 0) this.lights.select(lamp);
  }

  private status(text: string): void {
    status.textContent = text;
  }

  private setLook(change: Partial<Look>): void {
    const retrace = change.layer !== undefined;
    Object.assign(this.look, change);
    if (retrace) this.stage.move();
    else this.stage.display();
  }

  private fillPanel(controls: Controls): void {
    const { meta } = this;
    const panel = byId("panel");
    panel.append(element("h1", {}, meta.title));
    if (meta.kind === "training") panel.append(new Training((scene) => this.follower.follow(scene)).part());
    if (meta.views.length > 0) {
      const views = meta.views.map((view) => {
        const made = button("", () => this.jump(view));
        made.setAttribute("aria-label", `view ${view.name}`);
        if (view.photograph) made.append(element("img", { src: view.photograph, alt: "", loading: "lazy" }));
        made.append(view.name);
        return made;
      });
      const parts: Node[] = [element("div", { class: "views" }, ...views)];
      if (meta.views.some((view) => view.photograph)) {
        this.compareSlider.input.disabled = true;
        parts.push(this.compareBox.label, this.compareSlider.label);
      }
      panel.append(section("Views", ...parts));
    }
    const exposure = slider("exposure", { min: -8, max: 8, step: 0.1 }, this.look.exposure, (value) => this.setLook({ exposure: value }));
    panel.append(
      section(
        "Picture",
        select("show", LAYERS, "radiance", (layer) => this.setLook({ layer: layer as Layer })),
        exposure.label,
        select("tone map", meta.toneMaps.map((one) => one.name), this.look.toneMap, (toneMap) => this.setLook({ toneMap })),
      ),
      section(
        "Moving",
        choice<Mode>(["walk", "orbit"], "walk", async (mode) => {
          controls.mode = mode;
          const centre = await this.stage.pick(0.5, 0.5);
          if (centre) controls.distance = centre.distance;
        }),
        element("p", {}, "W A S D walk, Q and E go down and up, Shift hurries, drag or arrows turn, L locks the pointer. Two fingers move."),
      ),
    );
    const boxes = this.lights.boxes();
    if (boxes.length > 0) panel.append(section("Lamps", ...boxes));
    panel.append(this.tools.part());
    const { live } = this;
    if (live) {
      this.lights.onSet = (name, factor) => void live.act({ "set-light": { name, factor } });
      panel.append(section("Edit script", ...live.parts()));
    }
    if (this.stills) panel.append(this.stills.part());
    panel.append(this.path.part());
  }
}
