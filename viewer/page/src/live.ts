// The edit of a page that a server shows: acts go there, and all pages of it follow.

import { button, element } from "./panel.ts";
import { poll } from "./poll.ts";

export interface Still {
  state: { is: "waiting" | "rendering" | "done" | "failed"; seconds?: number; problem?: string };
  file: string;
}

export interface EditState {
  revision: number;
  factors: Record<string, number[]>;
  script: string;
  file: string;
  canUndo: boolean;
  canRedo: boolean;
  /** The scene that is shown; 0 is that of the page. */
  scene: number;
  /** Whether the light fits the scene. */
  light: { state: "fits" | "waiting" | "baking" | "stale"; task?: string; share?: number; problem?: string };
  stills: Still[];
}

/** A step of an edit script: what, and then. */
export interface Step {
  select?: unknown;
  insert?: unknown;
  trim?: string;
  then?: unknown[];
}

type Act = { "set-light": { name: string; factor: number[] } } | { step: Step } | "undo" | "redo";

/** Which of the Gaussians of a scene are selected. */
export interface Selected {
  scene: number;
  num: number;
  bounds: [number[], number[]] | null;
  /** A bit for each in the order of the page, base64. */
  bits: string;
}

export class Live {
  private revision = -1;
  private readonly script = element("pre", { class: "script", tabindex: "0", "aria-label": "edit script" });
  private readonly file = element("p");
  private readonly undo = button("undo", () => void this.act("undo"));
  private readonly redo = button("redo", () => void this.act("redo"));
  private readonly light = element("p", { role: "status", class: "light" });
  private readonly progress = element("progress", { max: "1", "aria-label": "progress of the bake" });
  private readonly stop = button("stop", () => void this.post("light", "stop"));
  private readonly bake = button("bake", () => void this.post("light", "bake"));

  /** `changed` is told of every state, `told` of what goes wrong, in words. */
  constructor(
    private readonly changed: (state: EditState) => void,
    private readonly told: (problem: string) => void,
  ) {
    const take = (state: EditState) => {
      this.take(state);
      return true;
    };
    void poll(() => this.revision, take);
  }

  /** Undo, redo, the script, and what becomes of the light. */
  parts(): Node[] {
    return [
      element("div", { class: "row" }, this.undo, this.redo, this.stop, this.bake),
      this.light,
      this.progress,
      this.script,
      this.file,
    ];
  }

  async act(act: Act): Promise<boolean> {
    return this.post("act", act);
  }

  /** Sends an order whose answer is the new state; whether it was taken. */
  async post(place: string, order: unknown): Promise<boolean> {
    const state = await this.ask<EditState>(place, order);
    if (state) this.take(state);
    return state !== null;
  }

  /** Which Gaussians a selector selects; `null` where it cannot be one. */
  select(selector: unknown): Promise<Selected | null> {
    return this.ask<Selected>("select", { select: selector });
  }

  private async ask<T>(place: string, order: unknown): Promise<T | null> {
    try {
      const headers = { "Content-Type": "application/json" };
      const answer = await fetch(place, { method: "POST", headers, body: JSON.stringify(order) });
      const body = await answer.json();
      if (answer.ok) return body as T;
      this.told((body as { error: string }).error);
    } catch {
      this.told("the server does not answer: `eagpt view` has ended");
    }
    return null;
  }

  private take(state: EditState): void {
    // Answers may overtake each other.
    if (state.revision <= this.revision) return;
    this.revision = state.revision;
    this.script.textContent = state.script;
    this.file.textContent = `saved as ${state.file}`;
    this.undo.disabled = !state.canUndo;
    this.redo.disabled = !state.canRedo;
    this.tellLight(state.light);
    this.changed(state);
  }

  private tellLight({ state, task, share, problem }: EditState["light"]): void {
    const words = {
      fits: "",
      waiting: "The light is that of before: a bake waits.",
      baking: `The light is that of before: ${task ?? ""}.`,
      stale: `The light is that of before: ${problem ?? ""}`,
    };
    // Told anew only when it is something else: screen readers read it out.
    if (this.light.textContent !== words[state]) this.light.textContent = words[state];
    const isUnderWay = state === "waiting" || state === "baking";
    this.progress.hidden = !isUnderWay;
    this.progress.value = share ?? 0;
    this.stop.hidden = !isUnderWay;
    this.bake.hidden = state !== "stale";
  }
}
