// Selections of a press, and shapes that may be inserted.

import { luminance } from "./lights.ts";
import { tidy } from "./panel.ts";
import type { Scene } from "./scene.ts";
import type { Kind } from "./shapes.ts";

/** Things that may be inserted: a shape, and whether it emits. */
export const INSERTS: Record<string, { kind: Kind; emits: boolean; stands: boolean }> = {
  ball: { kind: "ball", emits: false, stands: false },
  box: { kind: "box", emits: false, stands: false },
  "lying quad": { kind: "quad", emits: false, stands: false },
  "standing quad": { kind: "quad", emits: false, stands: true },
  "ball lamp": { kind: "ball", emits: true, stands: false },
  "lying panel lamp": { kind: "quad", emits: true, stands: false },
  "standing panel lamp": { kind: "quad", emits: true, stands: true },
};

/** How far what hangs together goes. */
export interface Bounds {
  /** Radius of the sphere that it ends in, scene units; `null` is none. */
  within: number | null;
  /** Most that albedos differ by, luminance; `null` is any. */
  alike: number | null;
  /** Sizes of a disc that the next one may be away. */
  reach: number;
}

/** The selector of what hangs together with a disc. */
export function clusterAt(scene: Scene, disc: number, { within, alike, reach }: Bounds): unknown {
  const three = (column: Float32Array) => [...column.subarray(3 * disc, 3 * disc + 3)];
  const seed = three(scene.positions).map(tidy);
  const own = luminance(three(scene.albedos));
  const ends = {
    ...(within !== null && { sphere: { centre: seed, radius: tidy(within) } }),
    ...(alike !== null && { albedo: { min: tidy(Math.max(0, own - alike)), max: tidy(own + alike) } }),
  };
  return { cluster: { seed, reach, ...(Object.keys(ends).length > 0 && { within: ends }) } };
}
