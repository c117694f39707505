// Path-traced pictures of the present view, made by the server.

import type { EditState, Live, Still } from "./live.ts";
import type { Look } from "./renderer.ts";
import type { Pinhole } from "./bins.ts";
import { button, element, section, select } from "./panel.ts";
import { pathFile } from "./path.ts";

/** Most pixels along the longer edge. */
const MAX_EDGE = 1920;

export class Stills {
  private samples = "64";
  private readonly list = element("div", { role: "status" });
  private readonly picture = element("img", { alt: "Path-traced picture of the scene" });
  private readonly dialog = element("dialog", { class: "still", "aria-label": "Path-traced picture" }, this.picture);
  private readonly begun = new Map<number, number>();
  private shown = "";
  private known: Still[] = [];
  /** Stills that were there already are not shown by themselves. */
  private numSeen = -1;

  constructor(
    private readonly live: Live,
    private readonly camera: (width: number, height: number) => Pinhole,
    private readonly size: () => [number, number],
    private readonly look: () => Look,
  ) {
    this.dialog.append(button("close", () => this.dialog.close()));
    document.body.append(this.dialog);
  }

  part(): HTMLElement {
    const order = button("path-trace this view", () => void this.order());
    const samples = select("samples", ["16", "64", "256", "1024"], this.samples, (value) => (this.samples = value));
    const made = section("Path-traced stills", samples, element("div", { class: "row" }, order), this.list);
    made.open = false;
    return made;
  }

  async order(): Promise<void> {
    const [width, height] = this.size();
    const by = Math.min(1, MAX_EDGE / Math.max(width, height));
    const [w, h] = [width, height].map((edge) => Math.max(1, Math.round(edge * by)));
    const { exposure, toneMap } = this.look();
    const path = pathFile([this.camera(w, h)], w, h);
    await this.live.post("still", { path, samples: Number(this.samples), exposure, toneMap });
  }

  /** For tests: files of all of them. */
  files(): string[] {
    return this.known.map((still) => still.file);
  }

  follow({ stills }: EditState): void {
    const text = JSON.stringify(stills);
    if (text === this.shown) return;
    this.shown = text;
    this.known = stills;
    const isDone = (still: Still) => still.state.is === "done";
    const num = stills.filter(isDone).length;
    this.list.replaceChildren(...stills.map((still, index) => this.line(still, index)));
    if (this.numSeen >= 0 && num > this.numSeen) this.open(stills.map(isDone).lastIndexOf(true));
    this.numSeen = num;
  }

  private line({ state, file }: Still, index: number): HTMLElement {
    const name = file.split(/[\\/]/).pop() ?? file;
    const words = {
      waiting: "waits",
      rendering: state.seconds ? `is being rendered, about ${Math.ceil(state.seconds)} s` : "is being rendered",
      done: `${(state.seconds ?? 0).toFixed(1)} s, saved as ${file}`,
      failed: state.problem ?? "",
    };
    const line = element("p", {}, `${name}: ${words[state.is]} `);
    if (state.is === "rendering" && state.seconds) line.append(this.progress(index, state.seconds));
    if (state.is === "done") line.append(button("show", () => this.open(index)));
    return line;
  }

  /** A bar that fills as fast as the server expects. */
  private progress(index: number, seconds: number): HTMLElement {
    const bar = element("progress", { max: "1", "aria-label": "progress of the picture" });
    const started = this.begun.get(index) ?? performance.now();
    this.begun.set(index, started);
    const timer = window.setInterval(() => {
      if (!bar.isConnected) window.clearInterval(timer);
      bar.value = Math.min(0.99, (performance.now() - started) / (1000 * seconds));
    }, 200);
    return bar;
  }

  private open(index: number): void {
    this.picture.src = `still?index=${index}`;
    if (!this.dialog.open) this.dialog.showModal();
  }
}
