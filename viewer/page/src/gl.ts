// Short names for what WebGL2 says at length.

import { ROW, VERTEX } from "./shaders.ts";

export type Gl = WebGL2RenderingContext;

/** A fullscreen pass: program and places of its uniforms. */
export class Pass {
  private readonly program: WebGLProgram;
  private readonly places = new Map<string, WebGLUniformLocation>();

  constructor(private readonly gl: Gl, name: string, fragment: string) {
    const program = gl.createProgram()!;
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, fragment]] as const) {
      const shader = gl.createShader(kind)!;
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) {
        throw new Error(`${name}: ${gl.getShaderInfoLog(shader)}`);
      }
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
      throw new Error(`${name}: ${gl.getProgramInfoLog(program)}`);
    }
    this.program = program;
    const num = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) as number;
    for (let i = 0; i < num; i++) {
      const uniform = gl.getActiveUniform(program, i)!.name;
      this.places.set(uniform, gl.getUniformLocation(program, uniform)!);
    }
  }

  use(): void {
    this.gl.useProgram(this.program);
  }

  private at(name: string): WebGLUniformLocation | null {
    // A uniform that the compiler has removed has no place, and setting nothing is right then.
    return this.places.get(name) ?? null;
  }

  int(name: string, value: number): void {
    this.gl.uniform1i(this.at(name), value);
  }

  float(name: string, value: number): void {
    this.gl.uniform1f(this.at(name), value);
  }

  vec2(name: string, [x, y]: number[]): void {
    this.gl.uniform2f(this.at(name), x, y);
  }

  vec3(name: string, [x, y, z]: number[]): void {
    this.gl.uniform3f(this.at(name), x, y, z);
  }

  ivec2(name: string, [x, y]: number[]): void {
    this.gl.uniform2i(this.at(name), x, y);
  }

  textures(textures: Record<string, WebGLTexture>): void {
    Object.entries(textures).forEach(([name, texture], unit) => {
      this.gl.activeTexture(this.gl.TEXTURE0 + unit);
      this.gl.bindTexture(this.gl.TEXTURE_2D, texture);
      this.int(name, unit);
    });
  }

  draw(): void {
    this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
  }
}

/** Formats of textures: internal, format, type. */
export const FORMATS = {
  rgba32f: ["RGBA32F", "RGBA", "FLOAT"],
  rgba16f: ["RGBA16F", "RGBA", "HALF_FLOAT"],
  rgba8: ["RGBA8", "RGBA", "UNSIGNED_BYTE"],
  rgba16i: ["RGBA16I", "RGBA_INTEGER", "SHORT"],
  r32ui: ["R32UI", "RED_INTEGER", "UNSIGNED_INT"],
} as const;

/** A texture of its own size; no filter, no mipmaps. */
export class Texture {
  readonly texture: WebGLTexture;
  width = 0;
  height = 0;

  constructor(private readonly gl: Gl, private readonly format: keyof typeof FORMATS) {
    this.texture = gl.createTexture()!;
  }

  /** Makes room; what was there is lost if the size is another. */
  resize(width: number, height: number): void {
    if (width === this.width && height === this.height) return;
    const { gl } = this;
    const limit = gl.getParameter(gl.MAX_TEXTURE_SIZE) as number;
    if (width > limit || height > limit) {
      throw new Error(`this graphics device has no textures of ${width} × ${height}, only ${limit}`);
    }
    const [internal, format, type] = FORMATS[this.format];
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl[internal], width, height, 0, gl[format], gl[type], null);
    for (const [name, value] of [
      [gl.TEXTURE_MIN_FILTER, gl.NEAREST],
      [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE],
      [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
    ]) {
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    }
    [this.width, this.height] = [width, height];
  }

  /** Uploads a list, `perTexel` values in a texel; grows by halves, and never shrinks. */
  list(values: ArrayBufferView & { length: number; subarray(a: number, b: number): ArrayBufferView }, perTexel: number): void {
    const { gl } = this;
    const num = values.length / perTexel;
    const rows = Math.max(1, Math.ceil(num / ROW));
    if (rows > this.height) this.resize(ROW, this.height === 0 ? rows : Math.max(rows, Math.ceil(1.5 * this.height)));
    const [, format, type] = FORMATS[this.format];
    const whole = Math.floor(num / ROW);
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    const put = (y: number, width: number, height: number, part: ArrayBufferView) =>
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, y, width, height, gl[format], gl[type], part);
    if (whole > 0) put(0, ROW, whole, values.subarray(0, whole * ROW * perTexel));
    if (num > whole * ROW) {
      put(whole, num - whole * ROW, 1, values.subarray(whole * ROW * perTexel, values.length));
    }
  }
}

/** Framebuffer of some textures of one size. */
export function framebuffer(gl: Gl, textures: Texture[]): WebGLFramebuffer {
  const target = gl.createFramebuffer()!;
  gl.bindFramebuffer(gl.FRAMEBUFFER, target);
  const places = textures.map((texture, i) => {
    const place = gl.COLOR_ATTACHMENT0 + i;
    gl.framebufferTexture2D(gl.FRAMEBUFFER, place, gl.TEXTURE_2D, texture.texture, 0);
    return place;
  });
  gl.drawBuffers(places);
  if (gl.checkFramebufferStatus(gl.FRAMEBUFFER) !== gl.FRAMEBUFFER_COMPLETE) {
    throw new Error("this graphics device cannot draw to textures of floats");
  }
  return target;
}
