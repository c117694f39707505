// Walking and orbiting: mouse, touch, keys.

import type { Walker } from "./camera.ts";

export type Mode = "walk" | "orbit";

/** Radians for a pixel of a drag. */
const TURN = 0.004;

/** Points are 0 to 1 from the top left corner. */
export interface Listener {
  /** Told of every change of the walker. */
  moved: () => void;
  /** Told of a press without a drag. */
  clicked: (x: number, y: number) => void;
  /** Whether a drag paints, in place of turning the view. */
  paints: () => boolean;
  /** Told of the points of such a drag. */
  painted: (x: number, y: number, isLast: boolean) => void;
}

export class Controls {
  mode: Mode = "walk";
  /** Distance of what is orbited, scene units. */
  distance: number;
  private readonly held = new Set<string>();
  private readonly touches = new Map<number, [number, number]>();
  private last = 0;
  private dragged = 0;

  /** `speed` is in scene units for a second. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly walker: Walker,
    private readonly speed: number,
    private readonly listener: Listener,
  ) {
    this.distance = 2 * speed;
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.drag(event));
    for (const name of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(name, (event) => this.up(event));
    }
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("keyup", (event) => this.held.delete(event.code));
    window.addEventListener("blur", () => this.held.clear());
    canvas.addEventListener("blur", () => this.held.clear());
  }

  private turn(dx: number, dy: number): void {
    if (this.mode === "walk") this.walker.turn(TURN * dx, -TURN * dy);
    else this.walker.orbit(this.distance, -TURN * dx, TURN * dy);
    this.listener.moved();
  }

  private down(event: PointerEvent): void {
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.touches.set(event.pointerId, [event.clientX, event.clientY]);
    this.dragged = 0;
  }

  private drag(event: PointerEvent): void {
    if (document.pointerLockElement === this.canvas) {
      this.turn(event.movementX, event.movementY);
      return;
    }
    const before = this.touches.get(event.pointerId);
    if (!before) return;
    const now: [number, number] = [event.clientX, event.clientY];
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    this.dragged += Math.abs(dx) + Math.abs(dy);
    if (this.touches.size === 1) {
      this.touches.set(event.pointerId, now);
      if (this.listener.paints()) this.listener.painted(...this.place(event), false);
      else if (this.dragged > 3) this.turn(dx, dy);
      return;
    }
    // Two fingers: apart is ahead, together along is to the side.
    const spread = () => {
      const [a, b] = [...this.touches.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]);
    };
    const wide = spread();
    this.touches.set(event.pointerId, now);
    const per = (2 * this.speed) / this.canvas.clientHeight;
    this.walker.walk(-0.5 * per * dx, 0.5 * per * dy, 0);
    this.walker.approach(per * (spread() - wide));
    this.listener.moved();
  }

  private up(event: PointerEvent): void {
    if (this.touches.size === 1 && event.type === "pointerup") {
      if (this.dragged <= 3) this.listener.clicked(...this.place(event));
      else if (this.listener.paints()) this.listener.painted(...this.place(event), true);
    }
    this.touches.delete(event.pointerId);
  }

  private place(event: PointerEvent): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const by = -Math.sign(event.deltaY) * 0.15 * (this.mode === "orbit" ? this.distance : this.speed);
    this.walker.approach(by);
    if (this.mode === "orbit") this.distance = Math.max(0.05 * this.speed, this.distance - by);
    this.listener.moved();
  }

  /** Mouse movements turn the view until Escape. */
  lock(): void {
    // Refused where the browser has no pointer to lock, as on phones: dragging works there.
    Promise.resolve(this.canvas.requestPointerLock()).catch(() => {});
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.code === "KeyL") this.lock();
    if (!(event.code in MOVES) && !(event.code in TURNS)) return;
    event.preventDefault();
    const isFirst = this.held.size === 0;
    this.held.add(event.code);
    if (isFirst) {
      this.last = performance.now();
      requestAnimationFrame(() => this.step());
    }
    this.fast = event.shiftKey;
  }

  private fast = false;

  private step(): void {
    const now = performance.now();
    const seconds = Math.min(0.2, (now - this.last) / 1000);
    this.last = now;
    if (this.held.size === 0) return;
    const by = this.speed * seconds * (this.fast ? 3 : 1);
    for (const code of this.held) {
      const move = MOVES[code];
      if (move) this.walker.walk(by * move[0], by * move[1], by * move[2]);
      const turn = TURNS[code];
      if (turn) this.turn((turn[0] * seconds) / TURN, (turn[1] * seconds) / TURN);
    }
    this.listener.moved();
    requestAnimationFrame(() => this.step());
  }
}

/** Right, up, ahead. */
const MOVES: Record<string, number[]> = {
  KeyW: [0, 0, 1],
  KeyS: [0, 0, -1],
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};
/** Right and down. */
const TURNS: Record<string, number[]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};
