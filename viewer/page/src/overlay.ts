// Lines and handles in the scene, drawn over the picture.

import { add, dot, type Vec } from "./camera.ts";
import type { Pinhole } from "./bins.ts";

const SVG = "http://www.w3.org/2000/svg";
/** Nearest that a point may be, lengths of the view direction. */
const NEAR = 1e-4;

export interface Line {
  points: Vec[];
  /** Class of its style. */
  look: "shape" | "measure" | "x" | "y" | "z";
}

/** A handle that is dragged along an axis of the world. */
export interface Handle {
  at: Vec;
  axis: Vec;
  look: "x" | "y" | "z";
  title: string;
  /** Told how far along the axis, scene units. */
  dragged: (by: number) => void;
}

export interface Drawing {
  lines: Line[];
  handles: Handle[];
}

/** Where a camera sees a point, pixels; `null` behind it. */
export function project(camera: Pinhole, point: number[]): [number, number] | null {
  const offset = add(point, camera.eye, -1);
  const depth = dot(offset, camera.forward);
  if (depth <= NEAR) return null;
  const { fx, fy, cx, cy } = camera;
  return [(fx * dot(offset, camera.right)) / depth + cx, (fy * dot(offset, camera.down)) / depth + cy];
}

export class Overlay {
  private readonly svg = document.createElementNS(SVG, "svg");
  private drawing: Drawing = { lines: [], handles: [] };
  /** While a handle is dragged its circle stays, so that it keeps the pointer. */
  private held: { handle: number; circle: SVGCircleElement } | null = null;

  constructor(private readonly canvas: HTMLCanvasElement, private readonly camera: (width: number, height: number) => Pinhole) {
    this.svg.id = "overlay";
    this.svg.setAttribute("aria-hidden", "true");
    canvas.after(this.svg);
  }

  show(drawing: Drawing): void {
    this.drawing = drawing;
    this.draw();
  }

  /** Draws anew, after the camera has moved. */
  draw(): void {
    const { offsetLeft, offsetTop, clientWidth, clientHeight } = this.canvas;
    const camera = this.camera(clientWidth, clientHeight);
    const place = { left: `${offsetLeft}px`, top: `${offsetTop}px`, width: `${clientWidth}px`, height: `${clientHeight}px` };
    Object.assign(this.svg.style, place);
    const parts: SVGElement[] = this.drawing.lines.map((line) => this.line(camera, line));
    this.drawing.handles.forEach((handle, index) => parts.push(this.handle(camera, handle, index)));
    // The held circle is moved, never taken out: it would lose the pointer.
    for (const child of [...this.svg.children]) if (child !== this.held?.circle) child.remove();
    this.svg.prepend(...parts.filter((part) => part !== this.held?.circle));
  }

  private line(camera: Pinhole, line: Line): SVGElement {
    const made = document.createElementNS(SVG, "path");
    made.setAttribute("class", line.look);
    let path = "";
    let before: [number, number] | null = null;
    for (const point of line.points) {
      const now = project(camera, point);
      if (now) path += `${before ? "L" : "M"}${now[0].toFixed(1)} ${now[1].toFixed(1)}`;
      before = now;
    }
    made.setAttribute("d", path);
    return made;
  }

  private handle(camera: Pinhole, handle: Handle, index: number): SVGElement {
    const circle = this.held?.handle === index ? this.held.circle : document.createElementNS(SVG, "circle");
    const at = project(camera, handle.at);
    circle.setAttribute("class", handle.look);
    circle.setAttribute("r", at ? "8" : "0");
    circle.setAttribute("cx", `${at?.[0] ?? 0}`);
    circle.setAttribute("cy", `${at?.[1] ?? 0}`);
    if (circle === this.held?.circle) return circle;
    const title = document.createElementNS(SVG, "title");
    title.textContent = handle.title;
    circle.append(title);
    circle.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      circle.setPointerCapture(event.pointerId);
      this.held = { handle: index, circle };
    });
    circle.addEventListener("pointermove", (event) => {
      if (this.held?.circle === circle) this.drag(index, event);
    });
    for (const name of ["pointerup", "pointercancel"] as const) {
      circle.addEventListener(name, () => {
        this.held = null;
        this.draw();
      });
    }
    return circle;
  }

  /** The pointer's way along the axis as the picture has it. */
  private drag(index: number, event: PointerEvent): void {
    const { at, axis, dragged } = this.drawing.handles[index];
    const camera = this.camera(this.canvas.clientWidth, this.canvas.clientHeight);
    const depth = dot(add(at, camera.eye, -1), camera.forward);
    // Steps on the axis as small as a hundredth of the distance: the picture is straight there.
    const step = 0.01 * depth;
    const [from, to] = [project(camera, at), project(camera, add(at, axis, step))];
    if (!from || !to) return;
    const box = this.canvas.getBoundingClientRect();
    const [dx, dy] = [event.clientX - box.left - from[0], event.clientY - box.top - from[1]];
    const [ax, ay] = [to[0] - from[0], to[1] - from[1]];
    const length2 = ax * ax + ay * ay;
    // An axis that points at the camera cannot be dragged along.
    if (length2 < 1e-3) return;
    dragged((step * (dx * ax + dy * ay)) / length2);
  }
}
