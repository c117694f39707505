// Where the picture is seen from: a camera of the dataset, or one that walks about upright.

import type { Pinhole } from "./bins.ts";
import type { ViewInfo } from "./scene.ts";

export type Vec = [number, number, number];

export const add = (a: number[], b: number[], by = 1): Vec => [a[0] + by * b[0], a[1] + by * b[1], a[2] + by * b[2]];
export const scaled = (a: number[], by: number): Vec => [a[0] * by, a[1] * by, a[2] * by];
export const dot = (a: number[], b: number[]): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: number[], b: number[]): Vec => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const unit = (a: number[]): Vec => scaled(a, 1 / Math.hypot(...a));

/** The camera of a view for a picture of another size: the vertical field of view stays. */
export function viewCamera(view: ViewInfo, width: number, height: number): Pinhole {
  const p = view.pose;
  const by = height / view.height;
  const centre = (at: number, old: number, now: number) => 0.5 * now + by * (at - 0.5 * old);
  return {
    width,
    height,
    fx: view.fx * by,
    fy: view.fy * by,
    cx: centre(view.cx, view.width, width),
    cy: centre(view.cy, view.height, height),
    right: [p[0], p[4], p[8]],
    down: [p[1], p[5], p[9]],
    forward: [p[2], p[6], p[10]],
    eye: [p[3], p[7], p[11]],
  };
}

/** Steepest look up and down, radians from the horizon. */
const STEEPEST = 1.55;

/** An upright camera: place, heading and pitch. */
export class Walker {
  /** Vertical field of view, radians. */
  fov = 1;
  private heading = 0;
  private pitch = 0;
  private readonly north: Vec;
  private readonly east: Vec;

  constructor(private readonly up: Vec, public eye: Vec) {
    const other: Vec = Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
    this.north = unit(add(other, up, -dot(other, up)));
    this.east = cross(this.north, up);
  }

  forward(): Vec {
    const level = add(scaled(this.north, Math.cos(this.heading)), this.east, Math.sin(this.heading));
    return add(scaled(level, Math.cos(this.pitch)), this.up, Math.sin(this.pitch));
  }

  lookAlong(forward: number[]): void {
    this.pitch = Math.max(-STEEPEST, Math.min(STEEPEST, Math.asin(Math.max(-1, Math.min(1, dot(forward, this.up))))));
    this.heading = Math.atan2(dot(forward, this.east), dot(forward, this.north));
  }

  take(camera: Pinhole): void {
    this.eye = [...camera.eye];
    this.lookAlong(camera.forward);
    this.fov = 2 * Math.atan((0.5 * camera.height) / camera.fy);
  }

  turn(right: number, up: number): void {
    this.heading += right;
    this.pitch = Math.max(-STEEPEST, Math.min(STEEPEST, this.pitch + up));
  }

  /** Moves in its own axes: right, up along the vertical, ahead along the horizon. */
  walk(right: number, up: number, ahead: number): void {
    const forward = this.forward();
    const side = unit(cross(forward, this.up));
    const level = cross(this.up, side);
    this.eye = add(add(add(this.eye, side, right), this.up, up), level, ahead);
  }

  /** Moves along the view direction. */
  approach(by: number): void {
    this.eye = add(this.eye, this.forward(), by);
  }

  /** Turns about a point that is `distance` ahead. */
  orbit(distance: number, right: number, up: number): void {
    const target = add(this.eye, this.forward(), distance);
    this.turn(right, up);
    this.eye = add(target, this.forward(), -distance);
  }

  camera(width: number, height: number): Pinhole {
    const forward = this.forward();
    const right = unit(cross(forward, this.up));
    const focal = (0.5 * height) / Math.tan(0.5 * this.fov);
    return {
      width,
      height,
      fx: focal,
      fy: focal,
      cx: 0.5 * width,
      cy: 0.5 * height,
      eye: [...this.eye],
      right,
      down: cross(forward, right),
      forward,
    };
  }
}
