// The edit of a page that a server shows: acts go there, and all pages of it follow.

import { button, element } from "./panel.ts";

export interface EditState {
  revision: number;
  factors: Record<string, number[]>;
  script: string;
  file: string;
  canUndo: boolean;
  canRedo: boolean;
}

type Act = { "set-light": { name: string; factor: number[] } } | "undo" | "redo";

/** Rest before the server is asked again after it did not answer, milliseconds. */
const RETRY_MS = 1000;

export class Live {
  private revision = -1;
  private readonly script = element("pre", { class: "script", tabindex: "0", "aria-label": "edit script" });
  private readonly file = element("p");
  private readonly undo = button("undo", () => void this.act("undo"));
  private readonly redo = button("redo", () => void this.act("redo"));

  /** `changed` is told of every state, `told` of what goes wrong, in words. */
  constructor(
    private readonly changed: (state: EditState) => void,
    private readonly told: (problem: string) => void,
  ) {
    void this.follow();
  }

  /** Undo, redo and the script. */
  parts(): Node[] {
    return [element("div", { class: "row" }, this.undo, this.redo), this.script, this.file];
  }

  async act(act: Act): Promise<void> {
    try {
      const headers = { "Content-Type": "application/json" };
      const answer = await fetch("act", { method: "POST", headers, body: JSON.stringify(act) });
      const body = await answer.json();
      if (answer.ok) this.take(body as EditState);
      else this.told((body as { error: string }).error);
    } catch {
      this.told("the server does not answer: `eagpt view` has ended");
    }
  }

  private take(state: EditState): void {
    // Answers may overtake each other.
    if (state.revision <= this.revision) return;
    this.revision = state.revision;
    this.script.textContent = state.script;
    this.file.textContent = `saved as ${state.file}`;
    this.undo.disabled = !state.canUndo;
    this.redo.disabled = !state.canRedo;
    this.changed(state);
  }

  /** Asks for the state after the one that is known, which comes when there is one. */
  private async follow(): Promise<never> {
    for (;;) {
      try {
        const after = this.revision < 0 ? "" : `?after=${this.revision}`;
        const answer = await fetch(`state${after}`);
        if (!answer.ok) throw new Error(answer.statusText);
        this.take((await answer.json()) as EditState);
      } catch {
        await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
      }
    }
  }
}
