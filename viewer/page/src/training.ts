// A training that is watched: how far it is, and the curve of its loss.

import { element, section } from "./panel.ts";
import { poll } from "./poll.ts";

interface Stage {
  name: string;
  iteration: number;
  total: number;
  loss: number;
  /** Iterations with their losses. */
  points: [number, number][];
}

interface TrainingState {
  revision: number;
  /** The scene that is shown; 0 is that of the page. */
  scene: number;
  num: number;
  stages: Stage[];
  /** How it has ended, in words. */
  end: string | null;
}

const SVG = "http://www.w3.org/2000/svg";
/** Of a chart, in its own units; the text below stands apart. */
const [WIDTH, HEIGHT, FOOT] = [260, 110, 14];

export class Training {
  private revision = -1;
  private readonly stages = element("div");
  private readonly told = element("p", { role: "status" });

  /** `shown` gets the number of the scene to show. */
  constructor(private readonly shown: (scene: number) => void) {
    void poll<TrainingState>(() => this.revision, (state) => this.take(state));
  }

  part(): HTMLElement {
    return section("Training", this.told, this.stages);
  }

  private take(state: TrainingState): boolean {
    this.revision = state.revision;
    const last = state.stages.at(-1);
    const words = state.end ?? (last ? `Stage ${last.name} is under way.` : "The training begins.");
    // Told anew only when it is something else: screen readers read it out.
    if (this.told.textContent !== words) this.told.textContent = words;
    this.stages.replaceChildren(...state.stages.map(chart));
    this.shown(state.scene);
    return state.end === null;
  }
}

/** A loss curve: iterations to the right, the logarithm of the loss upwards. */
function chart({ name, iteration, total, loss, points }: Stage): HTMLElement {
  const caption = `${name}: iteration ${iteration.toLocaleString("en")} of ${total.toLocaleString("en")}, loss ${loss.toPrecision(3)}`;
  const figure = element("figure", { class: "curve" }, element("figcaption", {}, caption));
  const seen = points.filter(([, value]) => value > 0);
  if (seen.length < 2) return figure;
  const logs = seen.map(([, value]) => Math.log10(value));
  const [low, high] = [Math.min(...logs), Math.max(...logs)];
  const x = (at: number) => (WIDTH * at) / total;
  const y = (log: number) => 4 + (HEIGHT - 8) * ((high - log) / Math.max(high - low, 1e-9));
  const make = (kind: string, attributes: Record<string, string | number>, text = "") => {
    const made = document.createElementNS(SVG, kind);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, `${value}`);
    made.textContent = text;
    return made;
  };
  const svg = make("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT + FOOT}`, role: "img", "aria-label": `loss of ${caption}` });
  const line = seen.map(([at], k) => `${x(at).toFixed(1)},${y(logs[k]).toFixed(1)}`).join(" ");
  svg.append(
    make("rect", { width: WIDTH, height: HEIGHT }),
    make("polyline", { points: line }),
    make("text", { x: 4, y: 14 }, (10 ** high).toPrecision(2)),
    make("text", { x: 4, y: HEIGHT - 6 }, (10 ** low).toPrecision(2)),
    make("text", { x: WIDTH, y: HEIGHT + 11, "text-anchor": "end" }, `${total.toLocaleString("en")} iterations`),
  );
  figure.append(svg);
  return figure;
}
