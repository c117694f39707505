// The lamps of the panel: where the page has the light of each alone, with power and colour.

import { button, element, slider } from "./panel.ts";
import { mixed, type LampInfo, type Meta, type Scene } from "./scene.ts";

/** How a light shines: as a part of what it was, and a tint that keeps its luminance. */
export interface Dial {
  on: boolean;
  /** Stops; 0 is as it was. */
  stops: number;
  /** `#rrggbb`; white is as it was. */
  colour: string;
}

export const luminance = (rgb: number[]) => 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];

/** Linear light of a colour of the display, `#rrggbb`. */
export function linearOf(colour: string): number[] {
  const codes = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16) / 255);
  return codes.map((v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
}

/** Factors of the channels. */
export function factorOf(dial: Dial): number[] {
  if (!dial.on) return [0, 0, 0];
  const light = linearOf(dial.colour);
  const brightness = luminance(light);
  const tint = brightness > 0 ? light.map((v) => v / brightness) : [1, 1, 1];
  return tint.map((v) => v * 2 ** dial.stops);
}

/** The dial of a factor, as far as a display can show its colour. */
export function dialOf(factor: number[]): Dial {
  const brightness = luminance(factor);
  if (brightness <= 0) return { on: false, stops: 0, colour: "#ffffff" };
  const brightest = Math.max(...factor);
  const codes = factor.map((v) => {
    const x = v / brightest;
    return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
  });
  const colour = `#${codes.map((code) => code.toString(16).padStart(2, "0")).join("")}`;
  return { on: true, stops: Math.log2(brightness), colour };
}

/** Elements that show a dial. */
interface DialInputs {
  on: HTMLInputElement;
  colour: HTMLInputElement;
  power: (stops: number) => void;
}

export class Lights {
  /** Told of a light when its controls are let go. */
  onSet: ((name: string, factor: number[]) => void) | null = null;
  private readonly dials: Dial[];
  /** The light that is shown: of a server, or of the dials. */
  private readonly factors: number[][];
  private readonly marks = new Map<number, HTMLButtonElement>();
  private readonly inputs = new Map<string, DialInputs>();
  private waiting = false;

  /** `shown` gets new radiances, `marked` the lamp to mark, from 1, or 0. */
  constructor(
    private readonly meta: Meta,
    private scene: Scene,
    private readonly shown: (radiances: Float32Array) => void,
    private readonly marked: (lamp: number) => void,
  ) {
    this.dials = meta.lights.map(() => ({ on: true, stops: 0, colour: "#ffffff" }));
    this.factors = meta.lights.map(() => [1, 1, 1]);
  }

  /** Factors in single precision, as a server has them. */
  shownFactors(): number[][] {
    return this.factors.map((factor) => factor.map(Math.fround));
  }

  /** Takes another scene: one without light of each lamp shows the light it comes with. */
  take(scene: Scene): void {
    this.scene = scene;
    this.show();
  }

  private index(name: string): number {
    const index = this.meta.lights.indexOf(name);
    if (index < 0) throw new Error(`light: no \`${name}\``);
    return index;
  }

  /** Factors of another page, or of an act that was undone. */
  follow(factors: Record<string, number[]>): void {
    for (const [name, factor] of Object.entries(factors)) {
      const index = this.index(name);
      if (this.factors[index].every((value, k) => Math.fround(value) === Math.fround(factor[k]))) continue;
      this.factors[index] = factor;
      const dial = dialOf(factor);
      // A lamp that is off keeps the power that it comes back with.
      this.dials[index] = dial.on ? dial : { ...this.dials[index], on: false };
      const inputs = this.inputs.get(name);
      if (inputs) {
        inputs.on.checked = dial.on;
        inputs.colour.value = this.dials[index].colour;
        inputs.power(this.dials[index].stops);
      }
    }
    this.show();
  }

  /** Sets a light, as its controls do. */
  set(name: string, change: Partial<Dial>): void {
    const index = this.index(name);
    Object.assign(this.dials[index], change);
    this.factors[index] = factorOf(this.dials[index]);
    this.show();
  }

  /** The controls of a light were let go. */
  private settle(name: string): void {
    this.onSet?.(name, this.factors[this.index(name)]);
  }

  private show(): void {
    if (this.waiting) return;
    this.waiting = true;
    // Sliders tell more often than pictures are shown.
    requestAnimationFrame(() => {
      this.waiting = false;
      if (this.scene.lights.length > 0) this.shown(mixed(this.scene, this.factors));
    });
  }

  /** Boxes of all lamps, and of the light that belongs to none. */
  boxes(): HTMLElement[] {
    const { lamps, lights } = this.meta;
    const boxes = lamps.map((lamp, i) => this.box(lamp.name, lamp, i + 1));
    const others = lights.filter((name) => !lamps.some((lamp) => lamp.name === name));
    return [...boxes, ...others.map((name) => this.box(name, null, 0))];
  }

  private box(name: string, lamp: LampInfo | null, id: number): HTMLElement {
    const header = element("header", {}, element("b", {}, name));
    const box = element("div", { class: "lamp" }, header);
    if (this.meta.lights.includes(name)) box.append(...this.controls(name, header));
    if (lamp) {
      header.append(this.mark(id));
      const power = lamp.power.map((value) => value.toPrecision(3)).join(", ");
      box.append(element("p", {}, `${lamp.shape}, power ${power}`));
    }
    return box;
  }

  private controls(name: string, header: HTMLElement): Node[] {
    const power = slider("power", { min: -6, max: 4, step: 0.1 }, 0, (stops) => this.set(name, { stops }));
    power.input.setAttribute("aria-label", `power of ${name}, stops`);
    const colour = element("input", { type: "color", value: "#ffffff", "aria-label": `colour of ${name}` });
    colour.addEventListener("input", () => this.set(name, { colour: colour.value }));
    const on = element("input", { type: "checkbox", "aria-label": `${name} is on` });
    on.checked = true;
    on.addEventListener("change", () => this.set(name, { on: on.checked }));
    header.prepend(on);
    for (const input of [power.input, colour, on]) input.addEventListener("change", () => this.settle(name));
    this.inputs.set(name, { on, colour, power: power.set });
    return [power.label, element("label", {}, "colour", colour)];
  }

  /** Shows the box of a lamp, from 1, and marks the lamp. */
  select(id: number): void {
    const box = this.marks.get(id);
    if (!box) return;
    if (box.getAttribute("aria-pressed") !== "true") box.click();
    box.closest("details")!.open = true;
    box.scrollIntoView({ block: "nearest" });
  }

  private mark(id: number): HTMLButtonElement {
    const made = button("mark", () => {
      const isMarked = made.getAttribute("aria-pressed") === "true";
      document.querySelectorAll(".lamp button").forEach((other) => other.setAttribute("aria-pressed", "false"));
      made.setAttribute("aria-pressed", `${!isMarked}`);
      this.marked(isMarked ? 0 : id);
    });
    made.setAttribute("aria-pressed", "false");
    this.marks.set(id, made);
    return made;
  }
}
