// Balls, quads and boxes: as edit scripts have them, and as lines.

import { add, cross, dot, scaled, unit, type Vec } from "./camera.ts";
import type { Line } from "./overlay.ts";
import { tidy } from "./panel.ts";

export type Kind = "ball" | "quad" | "box";

/** A shape that stands upright, turned about the vertical. */
export interface Shape {
  kind: Kind;
  centre: Vec;
  /** Lengths along its side, its depth and upwards; of a ball the first is the diameter, of a quad the
   * first two are its edges, the second one upwards if it stands. */
  size: Vec;
  degrees: number;
  /** Whether a quad stands, or lies. */
  stands: boolean;
}

const vec = (v: number[]) => v.map(tidy);

/** The axes of a shape: its side, its depth, up. */
export function axesOf(shape: Shape, up: Vec): [Vec, Vec, Vec] {
  // The axis that a script's box has as its first, turned as it turns it.
  const angle = (shape.degrees * Math.PI) / 180;
  const turn = (v: Vec): Vec => {
    const along = dot(v, up);
    const flat = add(v, up, -along);
    return add(add(scaled(flat, Math.cos(angle)), cross(up, flat), Math.sin(angle)), up, along);
  };
  const world: Vec[] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const others = world.filter((axis) => Math.abs(dot(axis, up)) < 0.5);
  return [unit(turn(others[0])), unit(turn(others[1])), up];
}

/** Sizes along the axes of the world, before it turns. */
function worldSize(shape: Shape, up: Vec): Vec {
  const [side, depth, height] = shape.size;
  const along = up.map((value) => Math.abs(value) > 0.5);
  const level = [side, depth];
  return along.map((is) => (is ? height : level.shift()!)) as Vec;
}

/** Edges of a quad. */
function edges(shape: Shape, up: Vec): [Vec, Vec] {
  const [side, depth] = axesOf(shape, up);
  const [width, height] = shape.size;
  return [scaled(side, width), scaled(shape.stands ? up : depth, height)];
}

/** The surface of a step that inserts it; `material` has albedo or radiance. */
export function surface(shape: Shape, up: Vec, material: Record<string, unknown>) {
  const centre = vec(shape.centre);
  if (shape.kind === "ball") return { ball: { centre, radius: tidy(0.5 * shape.size[0]), ...material } };
  if (shape.kind === "quad") {
    const [u, v] = edges(shape, up).map(vec);
    return { quad: { centre, u, v, ...material } };
  }
  return { box: { ...boxOf(shape, up), ...material } };
}

function boxOf(shape: Shape, up: Vec) {
  const box = { centre: vec(shape.centre), size: vec(worldSize(shape, up)) };
  return shape.degrees === 0 ? box : { ...box, rotate: { axis: vec(up), degrees: tidy(shape.degrees) } };
}

/** The selector of what is in it; of a ball and a box. */
export function region(shape: Shape, up: Vec) {
  if (shape.kind === "ball") return { sphere: { centre: vec(shape.centre), radius: tidy(0.5 * shape.size[0]) } };
  return { box: boxOf(shape, up) };
}

/** Its outline. */
export function outline(shape: Shape, up: Vec): Line[] {
  const { centre } = shape;
  const line = (points: Vec[]): Line => ({ points, look: "shape" });
  const at = (u: Vec, a: number, v: Vec, b: number) => add(add(centre, u, a), v, b);
  if (shape.kind === "ball") {
    const radius = 0.5 * shape.size[0];
    const [x, y, z] = axesOf(shape, up);
    const circle = (u: Vec, v: Vec) => {
      const angles = Array.from({ length: 49 }, (_, i) => (i * Math.PI) / 24);
      return line(angles.map((t) => at(u, radius * Math.cos(t), v, radius * Math.sin(t))));
    };
    return [circle(x, y), circle(y, z), circle(z, x)];
  }
  if (shape.kind === "quad") {
    const [u, v] = edges(shape, up);
    return [line([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]].map(([a, b]) => at(u, 0.5 * a, v, 0.5 * b)))];
  }
  const axes = axesOf(shape, up).map((axis, k) => scaled(axis, 0.5 * shape.size[k]));
  const corner = (i: number) =>
    axes.reduce<Vec>((sum, axis, k) => add(sum, axis, (i >> k) & 1 ? 1 : -1), centre);
  const pairs = [0, 1, 2].flatMap((k) =>
    [0, 1, 2, 3, 4, 5, 6, 7].filter((i) => !((i >> k) & 1)).map((i) => [corner(i), corner(i | (1 << k))]),
  );
  return pairs.map(line);
}
