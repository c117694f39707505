// Shows the scenes that a server makes, one after the other.

import { RETRY_MS } from "./poll.ts";
import { unpack, type Scene, type SceneMeta } from "./scene.ts";

export class Follower {
  /** Numbers of the scene that is wanted and of that which is shown; 0 is the page's own. */
  private wanted = 0;
  private shown = 0;
  private last: Promise<void> = Promise.resolve();

  /** `take` shows a scene, `told` hears why there is none yet. */
  constructor(
    private readonly own: Scene,
    private readonly take: (scene: Scene, id: number) => Promise<void>,
    private readonly told: (problem: string) => void,
  ) {}

  follow(id: number): void {
    if (id === this.wanted) return;
    this.wanted = id;
    // In turn: a scene that came late must not replace a later one.
    this.last = this.last.then(() => this.show(id));
  }

  /** Whether the scene of the server is the one that is shown. */
  isThere(): boolean {
    return this.wanted === this.shown;
  }

  private async show(id: number): Promise<void> {
    const scene = id === 0 ? this.own : await this.fetched(id);
    if (!scene || id !== this.wanted) return;
    await this.take(scene, id);
    this.shown = id;
  }

  /** A scene of the server; `null` if it shows another one by now, whose number is on its way. */
  private async fetched(id: number): Promise<Scene | null> {
    while (id === this.wanted) {
      try {
        const answer = await fetch(`scene?id=${id}`);
        if (answer.status === 404) return null;
        const packed = (await answer.json()) as { meta: SceneMeta; data: string; error?: string };
        if (packed.error !== undefined) {
          this.told(packed.error);
          return null;
        }
        return await unpack(packed.meta, packed.data);
      } catch {
        this.told("the scene does not arrive: is the server still there?");
        await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
      }
    }
    return null;
  }
}
