// Tools of a press in the picture: looks, measures, selects, inserts; and what is done with it.

import { add, scaled, type Vec } from "./camera.ts";
import { linearOf, luminance } from "./lights.ts";
import type { Live, Selected } from "./live.ts";
import type { Drawing, Line, Overlay } from "./overlay.ts";
import { button, checkbox, choice, element, numbers, section, select, slider, tidy } from "./panel.ts";
import type { Picked } from "./renderer.ts";
import { bytesOf, type Meta, type Scene } from "./scene.ts";
import { clusterAt, INSERTS } from "./selectors.ts";
import { outline, region, surface, type Shape } from "./shapes.ts";
import type { Stage } from "./stage.ts";

export type Tool = "look" | "measure" | "select" | "box" | "brush" | "insert";

/** Most spheres of a brush: a request of them is small. */
const MAX_SPHERES = 200;
const AXES = ["x", "y", "z"] as const;

export class Tools {
  tool: Tool = "look";
  /** The selector of what is selected, and what the server says it is. */
  private selector: unknown = null;
  selected: Selected | null = null;
  private spheres: { sphere: { centre: number[]; radius: number } }[] = [];
  private points: Vec[] = [];
  private shape: Shape;
  private offset: Vec = [0, 0, 0];
  private insert = "ball";
  private sceneId = 0;
  private readonly size: number;
  private readonly said = element("p", { role: "status" });
  private readonly options = element("div");
  private readonly actions = element("div");
  private readonly place = numbers(["x", "y", "z"], [0, 0, 0], (at) => this.moveShape(at as Vec));
  private readonly sizes = numbers(["width", "depth", "height"], [1, 1, 1], (size) => this.setShape({ size: size.map(Math.abs) as Vec }));
  private readonly by = numbers(["by x", "by y", "by z"], [0, 0, 0], (by) => this.moveBy(by as Vec));
  private readonly turn = slider("turn", { min: -180, max: 180, step: 5 }, 0, (degrees) => this.setShape({ degrees }));
  private readonly reach = slider("reach", { min: 0.5, max: 8, step: 0.25 }, 3, () => void this.again());
  private readonly alike = slider("alike", { min: 0.05, max: 1, step: 0.05 }, 1, () => void this.again());
  private readonly within: ReturnType<typeof slider>;
  private readonly brush: ReturnType<typeof slider>;
  private readonly colour = element("input", { type: "color", value: "#c8c8c8" });
  private readonly power = slider("stops", { min: -4, max: 8, step: 0.5 }, 3, () => {});
  private readonly trim = checkbox("trim discs at the boundary", () => {});
  /** Makes the selector of the last press anew, with other options. */
  private remake: (() => unknown) | null = null;

  constructor(
    private readonly meta: Meta,
    private scene: Scene,
    private readonly stage: Stage,
    private readonly overlay: Overlay,
    /** `null` where no server keeps an edit. */
    private readonly live: Live | null,
    private readonly looked: (picked: Picked) => void,
  ) {
    const [low, high] = meta.bounds;
    this.size = Math.hypot(...low.map((value, k) => high[k] - value));
    const steps = { min: 0.005, max: 1, step: 0.005 };
    this.within = slider("within", steps, 0.15, () => void this.again());
    this.brush = slider("brush", { min: 0.002, max: 0.1, step: 0.002 }, 0.01, () => {});
    const edge = tidy(0.05 * this.size);
    this.shape = { kind: "box", centre: low.map((v, k) => 0.5 * (v + high[k])) as Vec, size: [edge, edge, edge], degrees: 0, stands: false };
    this.alike.input.setAttribute("aria-description", "difference of albedos; 1 is any");
    for (const input of [this.within.input, this.brush.input]) input.setAttribute("aria-description", "parts of the scene's size");
    this.colour.setAttribute("aria-label", "colour");
  }

  part(): HTMLElement {
    const tools: Tool[] = this.live ? ["look", "measure", "select", "box", "brush", "insert"] : ["look", "measure"];
    const made = section("Tools", choice(tools, this.tool, (tool) => this.use(tool)), this.options, this.said, this.actions);
    this.use("look");
    return made;
  }

  /** Takes another scene. What was selected is looked for in it. */
  take(scene: Scene, id: number): void {
    this.scene = scene;
    this.sceneId = id;
    this.selected = null;
    if (this.selector !== null) void this.find(this.selector);
  }

  use(tool: Tool): void {
    this.tool = tool;
    this.points = [];
    this.offset = [0, 0, 0];
    const parts: Record<Tool, Node[]> = {
      look: [],
      measure: [element("p", {}, "Press on two points.")],
      select: [element("p", {}, "A press selects a lamp, or what hangs together."), this.reach.label, this.within.label, this.alike.label],
      box: [element("p", {}, "A press brings the box; handles move it."), this.place.row, this.sizes.row, this.turn.label,
        button("select", () => void this.find(region(this.shape, this.meta.up as Vec)))],
      brush: [element("p", {}, "Drag over what is to be selected."), this.brush.label],
      insert: [
        select("what", Object.keys(INSERTS), this.insert, (what) => this.setInsert(what)),
        this.place.row, this.sizes.row, this.turn.label,
        element("label", {}, "colour", this.colour), this.power.label,
        button("insert", () => void this.doInsert())],
    };
    this.options.replaceChildren(...parts[tool]);
    if (tool === "box") this.setShape({ kind: "box" });
    if (tool === "insert") this.setInsert(this.insert);
    if (tool === "brush") this.spheres = [];
    this.told("");
    this.showActions();
    this.draw();
  }

  /** Whether drags paint, in place of turning the view. */
  get paints(): boolean {
    return this.tool === "brush";
  }

  /** A press on the picture. */
  pressed(picked: Picked): void {
    const { tool } = this;
    if (tool === "look") this.looked(picked);
    else if (tool === "measure") this.measure(picked.point);
    else if (tool === "select") {
      this.remake = () => this.selectorOf(picked.disc);
      void this.again();
    } else if (tool === "brush") this.paint(picked, true);
    else this.moveShape(picked.point);
  }

  private measure(point: Vec): void {
    this.points = this.points.length === 1 ? [this.points[0], point] : [point];
    if (this.points.length === 2) {
      const [a, b] = this.points;
      const by = add(b, a, -1);
      this.told(`${tidy(Math.hypot(...by))} units: ${by.map(tidy).join(", ")}`);
    } else this.told("and another point");
    this.draw();
  }

  /** A sphere of the brush; the last of a stroke asks what is selected. */
  paint(picked: Picked, isLast: boolean): void {
    const radius = tidy(this.brush.input.valueAsNumber * this.size);
    const centre = picked.point.map(tidy);
    const isNew = this.spheres.every(({ sphere }) => Math.hypot(...add(sphere.centre, centre, -1)) > 0.5 * radius);
    if (isNew && this.spheres.length < MAX_SPHERES) this.spheres.push({ sphere: { centre, radius } });
    if (isLast) void this.find({ any: this.spheres });
  }

  private selectorOf(disc: number): unknown {
    const lamp = this.scene.lamps[disc];
    if (lamp > 0) return { lamp: this.meta.lamps[lamp - 1].name };
    const [within, alike, reach] = [this.within, this.alike, this.reach].map((one) => one.input.valueAsNumber);
    return clusterAt(this.scene, disc, { within: within < 1 ? within * this.size : null, alike: alike < 1 ? alike : null, reach });
  }

  private async again(): Promise<void> {
    if (this.tool === "select" && this.remake) await this.find(this.remake());
  }

  /** Selects. */
  async find(selector: unknown): Promise<void> {
    this.selector = selector;
    const selected = (await this.live?.select(selector)) ?? null;
    // Something else was selected since.
    if (selector !== this.selector) return;
    // Of a scene that is still on its way: it is looked for once that is shown.
    if (selected && selected.scene !== this.sceneId) return;
    this.selected = selected;
    this.stage.renderer.select(selected ? bytesOf(selected.bits) : null);
    this.stage.move();
    if (selected) this.told(`${selected.num.toLocaleString("en")} Gaussians selected`);
    this.offset = [0, 0, 0];
    this.by.set(this.offset);
    this.showActions();
    this.draw();
  }

  clear(): void {
    [this.selector, this.selected, this.remake, this.spheres] = [null, null, null, []];
    this.stage.renderer.select(null);
    this.stage.move();
    this.told("");
    this.showActions();
    this.draw();
  }

  private showActions(): void {
    if (!this.selected || this.selected.num === 0 || this.tool === "insert" || this.tool === "measure") {
      this.actions.replaceChildren();
      return;
    }
    const up = this.meta.up.map(tidy);
    const paint = () => ({ set_albedo: linearOf(this.colour.value).map(tidy) });
    const shine = () => ({ set_radiance: this.radiance() });
    const move = () => this.offset.map(tidy);
    const row = (...parts: Node[]) => element("div", { class: "row" }, ...parts);
    const act = (title: string, then: () => unknown[]) => button(title, () => void this.act(then()));
    this.actions.replaceChildren(
      row(act("delete", () => ["remove"]), act("lights off", () => ["lights_off"]), button("clear", () => this.clear())),
      element("p", {}, "By (the handles of the selection, too):"),
      this.by.row,
      row(act("move", () => [{ move: move() }]), act("duplicate", () => [{ duplicate: { move: move() } }]),
        act("turn 15°", () => [{ rotate: { axis: up, degrees: 15 } }])),
      element("label", {}, "colour", this.colour),
      this.power.label,
      row(act("recolour", () => [paint()]), act("let shine", () => ["make_emissive", shine()])),
      this.trim.label,
    );
  }

  /** Radiance of the colour, of luminance 1 at 0 stops. */
  private radiance(): number[] {
    const light = linearOf(this.colour.value);
    const by = 2 ** this.power.input.valueAsNumber / Math.max(luminance(light), 1e-6);
    return light.map((v) => tidy(v * by));
  }

  /** A step that does something with the selection. */
  async act(then: unknown[]): Promise<void> {
    if (this.selector === null) return;
    const trim = this.trim.input.checked && this.hasBoundary() ? { trim: "shrink" } : {};
    const isDone = await this.live?.act({ step: { select: this.selector, ...trim, then } });
    if (isDone) this.clear();
  }

  /** Only regions have a boundary to trim at. */
  private hasBoundary(): boolean {
    return /"(box|sphere)"/.test(JSON.stringify(this.selector));
  }

  private setInsert(what: string): void {
    this.insert = what;
    this.setShape({ kind: INSERTS[what].kind, stands: INSERTS[what].stands });
  }

  async doInsert(): Promise<void> {
    const material = INSERTS[this.insert].emits
      ? { radiance: this.radiance() }
      : { albedo: linearOf(this.colour.value).map(tidy) };
    await this.live?.act({ step: { insert: surface(this.shape, this.meta.up as Vec, material) } });
  }

  private moveShape(at: Vec): void {
    this.setShape({ centre: at });
  }

  setShape(change: Partial<Shape>): void {
    Object.assign(this.shape, change);
    this.place.set(this.shape.centre);
    this.sizes.set(this.shape.size);
    this.draw();
  }

  private moveBy(by: Vec): void {
    this.offset = by;
    this.by.set(by);
    this.draw();
  }

  /** Handles that move a point along the axes of the world. */
  private handles(at: Vec, moved: (to: Vec) => void): Drawing {
    const length = 0.06 * this.size;
    const axes: Vec[] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    return {
      lines: axes.map((axis, k): Line => ({ points: [at, add(at, axis, length)], look: AXES[k] })),
      handles: axes.map((axis, k) => ({
        at: add(at, axis, length),
        axis,
        look: AXES[k],
        title: `move along ${AXES[k]}`,
        dragged: (by: number) => moved(add(at, axis, by)),
      })),
    };
  }

  private drawing(): Drawing {
    const { tool, meta, shape } = this;
    const none: Drawing = { lines: [], handles: [] };
    if (tool === "measure") return { ...none, lines: [{ points: this.points, look: "measure" }] };
    if ((tool === "box" && !this.selected) || tool === "insert") {
      const made = this.handles(shape.centre, (at) => this.moveShape(at));
      return { ...made, lines: [...outline(shape, meta.up as Vec), ...made.lines] };
    }
    if (!this.selected?.bounds) return none;
    const [low, high] = this.selected.bounds as [Vec, Vec];
    const middle = scaled(add(low, high), 0.5);
    const centre = add(middle, this.offset);
    const up: Vec = [0, 0, 1];
    const box: Shape = { kind: "box", centre, size: add(high, low, -1), degrees: 0, stands: false };
    const made = this.handles(centre, (at) => this.moveBy(add(at, middle, -1)));
    return { ...made, lines: [...outline(box, up), ...made.lines] };
  }

  draw(): void {
    this.overlay.show(this.drawing());
  }

  private told(text: string): void {
    this.said.textContent = text;
  }
}

