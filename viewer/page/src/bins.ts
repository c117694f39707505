// Which discs may be hit in which tile of an image, in order of the distance of their centres.
//
// The lists are supersets; the fragment shader decides. Bounds of a projected disc are those of the
// tracer: the extent of the conic about the projected centre.

/** Axes are OpenCV's: x right, y down, z forward, unit vectors in world space. */
export interface Pinhole {
  width: number;
  height: number;
  fx: number;
  fy: number;
  cx: number;
  cy: number;
  /** Centre of projection. */
  eye: [number, number, number];
  right: [number, number, number];
  down: [number, number, number];
  forward: [number, number, number];
}

/** Discs inside which hits count, `[3 n]` each; world space. */
export interface Discs {
  positions: Float32Array;
  /** Half axes: cut radius × standard deviation × tangent. */
  extentsU: Float32Array;
  extentsV: Float32Array;
}

export interface TileLists {
  /** First entry of each tile, row by row, and the end. */
  starts: Uint32Array;
  /** Indices of discs. */
  entries: Uint32Array;
  numVisible: number;
}

/** Safety margin of projected bounds, in pixels. */
const MARGIN_PIXELS = 0.02;

/** Finds lists; keeps its memory from image to image. */
export class Binner {
  private readonly num: number;
  private readonly keys: Uint32Array;
  private readonly visible: Uint32Array;
  private readonly rects: Uint16Array;
  private order: Uint32Array;
  private spare: Uint32Array;
  private pairTiles = new Uint32Array(1 << 16);
  private pairDiscs = new Uint32Array(1 << 16);

  constructor(private readonly discs: Discs) {
    this.num = discs.positions.length / 3;
    this.keys = new Uint32Array(this.num);
    this.visible = new Uint32Array(this.num);
    this.rects = new Uint16Array(4 * this.num);
    this.order = new Uint32Array(this.num);
    this.spare = new Uint32Array(this.num);
  }

  /** Lists of an image of tiles with `tile` pixels along each edge. */
  fill(camera: Pinhole, tile: number): TileLists {
    const numVisible = this.project(camera, tile);
    this.sort(numVisible);
    const tilesX = Math.ceil(camera.width / tile);
    const numTiles = tilesX * Math.ceil(camera.height / tile);
    const counts = new Uint32Array(numTiles + 1);
    const numPairs = this.pair(camera, tile, tilesX, numVisible, counts);
    for (let i = 0; i < numTiles; i++) counts[i + 1] += counts[i];
    const entries = new Uint32Array(numPairs);
    const next = counts.slice(0, numTiles);
    const { pairTiles, pairDiscs } = this;
    for (let i = 0; i < numPairs; i++) entries[next[pairTiles[i]]++] = pairDiscs[i];
    return { starts: counts, entries, numVisible };
  }

  /** Fills `visible`, with the range of tiles and the distance of each; returns their number. */
  private project(camera: Pinhole, tile: number): number {
    const { positions, extentsU, extentsV } = this.discs;
    const { width, height, fx, fy, cx, cy, eye, right: r, down: d, forward: f } = camera;
    const distances = new Float32Array(this.keys.buffer);
    // Inward unit normals of the planes through the eye and the image's edges, in camera space.
    const edge = (a: number, b: number): [number, number] => {
      const length = Math.hypot(a, b);
      return [a / length, b / length];
    };
    const [lx, lz] = edge(fx, cx);
    const [rx, rz] = edge(-fx, width - cx);
    const [ty, tz] = edge(fy, cy);
    const [by, bz] = edge(-fy, height - cy);
    let num = 0;
    for (let i = 0, k = 0; i < this.num; i++, k += 3) {
      const x = positions[k] - eye[0];
      const y = positions[k + 1] - eye[1];
      const z = positions[k + 2] - eye[2];
      const ux = extentsU[k], uy = extentsU[k + 1], uz = extentsU[k + 2];
      const vx = extentsV[k], vy = extentsV[k + 1], vz = extentsV[k + 2];
      const pz = x * f[0] + y * f[1] + z * f[2];
      const reach = Math.sqrt(Math.max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz));
      if (!(pz > -reach)) continue;
      const px = x * r[0] + y * r[1] + z * r[2];
      const py = x * d[0] + y * d[1] + z * d[2];
      const out = -1.00001 * reach - 1e-5 * (Math.abs(px) + Math.abs(py) + Math.abs(pz));
      if (px * lx + pz * lz < out || px * rx + pz * rz < out) continue;
      if (py * ty + pz * tz < out || py * by + pz * bz < out) continue;
      const az = ux * f[0] + uy * f[1] + uz * f[2];
      const bzz = vx * f[0] + vy * f[1] + vz * f[2];
      const reach2 = az * az + bzz * bzz;
      if (pz + Math.sqrt(reach2) <= 0) continue;
      const q = pz * pz - reach2;
      let x0 = 0, x1 = width, y0 = 0, y1 = height;
      // A disc that reaches into the camera's plane projects to an unbounded conic.
      if (pz > 0 && q > 1e-4 * pz * pz) {
        const mx = px / pz, my = py / pz;
        let ra = ux * r[0] + uy * r[1] + uz * r[2] - mx * az;
        let rb = vx * r[0] + vy * r[1] + vz * r[2] - mx * bzz;
        let half = ra * az + rb * bzz;
        let root = Math.sqrt(half * half + q * (ra * ra + rb * rb));
        x0 = Math.max(0, Math.ceil(fx * (mx + (-half - root) / q) + cx - MARGIN_PIXELS - 0.5));
        x1 = Math.min(width, Math.floor(fx * (mx + (root - half) / q) + cx + MARGIN_PIXELS + 0.5));
        ra = ux * d[0] + uy * d[1] + uz * d[2] - my * az;
        rb = vx * d[0] + vy * d[1] + vz * d[2] - my * bzz;
        half = ra * az + rb * bzz;
        root = Math.sqrt(half * half + q * (ra * ra + rb * rb));
        y0 = Math.max(0, Math.ceil(fy * (my + (-half - root) / q) + cy - MARGIN_PIXELS - 0.5));
        y1 = Math.min(height, Math.floor(fy * (my + (root - half) / q) + cy + MARGIN_PIXELS + 0.5));
        if (x0 >= x1 || y0 >= y1) continue;
      }
      this.visible[num] = i;
      distances[num] = Math.sqrt(x * x + y * y + z * z);
      const at = 4 * num;
      this.rects[at] = Math.floor(x0 / tile);
      this.rects[at + 1] = Math.floor((x1 - 1) / tile);
      this.rects[at + 2] = Math.floor(y0 / tile);
      this.rects[at + 3] = Math.floor((y1 - 1) / tile);
      num++;
    }
    return num;
  }

  /** Orders what is visible: bits of positive floats order as they do. Stable, so ties stay. */
  private sort(num: number): void {
    for (let i = 0; i < num; i++) this.order[i] = i;
    for (const shift of [0, 16]) {
      const starts = new Uint32Array(1 << 16);
      for (let i = 0; i < num; i++) starts[(this.keys[i] >>> shift) & 0xffff]++;
      let sum = 0;
      for (let i = 0; i < starts.length; i++) {
        const count = starts[i];
        starts[i] = sum;
        sum += count;
      }
      for (let i = 0; i < num; i++) {
        const at = this.order[i];
        this.spare[starts[(this.keys[at] >>> shift) & 0xffff]++] = at;
      }
      [this.order, this.spare] = [this.spare, this.order];
    }
  }

  /** Pairs of tile and disc, discs in order; counts those of each tile, one place further on. */
  private pair(
    camera: Pinhole,
    tile: number,
    tilesX: number,
    numVisible: number,
    counts: Uint32Array,
  ): number {
    const { rects } = this;
    const cover = new TileCover(camera, tile, this.discs);
    let num = 0;
    for (let i = 0; i < numVisible; i++) {
      const at = this.order[i];
      const disc = this.visible[at];
      const x0 = rects[4 * at], x1 = rects[4 * at + 1];
      const y0 = rects[4 * at + 2], y1 = rects[4 * at + 3];
      const size = (x1 - x0 + 1) * (y1 - y0 + 1);
      if (num + size > this.pairTiles.length) this.grow(num + size);
      // Of few tiles nearly all are covered.
      const few = size <= 2;
      if (!few) cover.set(disc);
      for (let y = y0; y <= y1; y++) {
        for (let x = x0; x <= x1; x++) {
          if (!few && !cover.mayHit(x, y)) continue;
          const index = y * tilesX + x;
          this.pairTiles[num] = index;
          this.pairDiscs[num++] = disc;
          counts[index + 1]++;
        }
      }
    }
    return num;
  }

  private grow(needed: number): void {
    const length = Math.max(needed, 2 * this.pairTiles.length);
    const enlarged = (old: Uint32Array) => {
      const larger = new Uint32Array(length);
      larger.set(old);
      return larger;
    };
    this.pairTiles = enlarged(this.pairTiles);
    this.pairDiscs = enlarged(this.pairDiscs);
  }
}

/**
 * Whether a ray of a tile may hit a disc. For a direction d, unnormalised, `u·(d·n)` is a linear
 * function of d, and so is `v·(d·n)`: over a tile each stays within its value in the middle plus or
 * minus the steps to the edges.
 */
class TileCover {
  private readonly base: number[];
  private readonly stepX: number[];
  private readonly stepY: number[];
  // Linear functions of the tile's column and row: [constant, by column, by row, reach].
  private readonly u = new Float64Array(4);
  private readonly v = new Float64Array(4);
  private readonly n = new Float64Array(4);

  constructor(private readonly camera: Pinhole, tile: number, private readonly discs: Discs) {
    const { fx, fy, cx, cy, right, down, forward } = camera;
    const at = (x: number, y: number) =>
      [0, 1, 2].map((k) => forward[k] + (right[k] * (x - cx)) / fx + (down[k] * (y - cy)) / fy);
    this.base = at(tile / 2, tile / 2);
    this.stepX = right.map((value) => (value * tile) / fx);
    this.stepY = down.map((value) => (value * tile) / fy);
  }

  set(disc: number): void {
    const { positions: p, extentsU: eu, extentsV: ev } = this.discs;
    const { eye } = this.camera;
    const k = 3 * disc;
    const ox = p[k] - eye[0], oy = p[k + 1] - eye[1], oz = p[k + 2] - eye[2];
    const uu = eu[k] ** 2 + eu[k + 1] ** 2 + eu[k + 2] ** 2;
    const vv = ev[k] ** 2 + ev[k + 1] ** 2 + ev[k + 2] ** 2;
    const ux = eu[k] / uu, uy = eu[k + 1] / uu, uz = eu[k + 2] / uu;
    const vx = ev[k] / vv, vy = ev[k + 1] / vv, vz = ev[k + 2] / vv;
    let nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    let plane = ox * nx + oy * ny + oz * nz;
    // Turned so that it is met where d·n is positive.
    if (plane < 0) [nx, ny, nz, plane] = [-nx, -ny, -nz, -plane];
    const offsetU = ox * ux + oy * uy + oz * uz;
    const offsetV = ox * vx + oy * vy + oz * vz;
    this.linear(this.u, ux * plane - nx * offsetU, uy * plane - ny * offsetU, uz * plane - nz * offsetU);
    this.linear(this.v, vx * plane - nx * offsetV, vy * plane - ny * offsetV, vz * plane - nz * offsetV);
    this.linear(this.n, nx, ny, nz);
  }

  private linear(out: Float64Array, x: number, y: number, z: number): void {
    const { base, stepX, stepY } = this;
    out[0] = x * base[0] + y * base[1] + z * base[2];
    out[1] = x * stepX[0] + y * stepX[1] + z * stepX[2];
    out[2] = x * stepY[0] + y * stepY[1] + z * stepY[2];
    out[3] = 0.5 * (Math.abs(out[1]) + Math.abs(out[2])) + 1e-6 * Math.abs(out[0]);
  }

  mayHit(x: number, y: number): boolean {
    const { u, v, n } = this;
    const cosine = n[0] + n[1] * x + n[2] * y + n[3];
    const du = Math.max(0, Math.abs(u[0] + u[1] * x + u[2] * y) - u[3]);
    const dv = Math.max(0, Math.abs(v[0] + v[1] * x + v[2] * y) - v[3]);
    return cosine > 0 && du * du + dv * dv <= cosine * cosine;
  }
}
