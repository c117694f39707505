// The passes: prepare (discs as one eye sees them), trace (a ray for each pixel), display.

/** Texels in a row of the textures that are lists. */
export const ROW = 4096;

const HEAD = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp isampler2D;
precision highp usampler2D;
`;

const LIST = `
ivec2 place(int i) { return ivec2(i & ${ROW - 1}, i >> ${Math.log2(ROW)}); }
`;

export const VERTEX = `${HEAD}
void main() {
  // One triangle that covers everything.
  vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

/** Numbers of the views of the scene, as the prepare pass knows them. */
export const LAYERS = ["radiance", "albedo", "normal", "emission", "lamps"] as const;
export type Layer = (typeof LAYERS)[number];

export function prepareShader(model: Record<string, number>): string {
  const constant = (name: string) => model[name].toExponential();
  return `${HEAD}${LIST}
uniform sampler2D positions, axesU, axesV, radiances, albedos;
uniform isampler2D harmonics;
uniform float harmonicStep, maxAlbedo;
uniform bool hasHarmonics;
uniform int layer;
uniform int num;
uniform vec3 eye;
uniform int highlighted;

layout(location = 0) out vec4 outU;
layout(location = 1) out vec4 outV;
layout(location = 2) out vec4 outPlane;
layout(location = 3) out vec4 outShown;

const float LINEAR = ${constant("HARMONIC_LINEAR")};
const float PRODUCT = ${constant("HARMONIC_PRODUCT")};
const float ZONAL = ${constant("HARMONIC_ZONAL")};
const float DIFFERENCE = ${constant("HARMONIC_DIFFERENCE")};
const float MAX_EXPONENT = ${constant("MAX_EXPONENT")};

vec3 factor(int i, vec3 d) {
  float y[8] = float[8](-LINEAR * d.y, LINEAR * d.z, -LINEAR * d.x, PRODUCT * d.x * d.y,
    -PRODUCT * d.y * d.z, ZONAL * (2.0 * d.z * d.z - d.x * d.x - d.y * d.y),
    -PRODUCT * d.x * d.z, DIFFERENCE * (d.x * d.x - d.y * d.y));
  float c[24];
  for (int k = 0; k < 6; k++) {
    vec4 four = vec4(texelFetch(harmonics, place(6 * i + k), 0));
    for (int l = 0; l < 4; l++) c[4 * k + l] = four[l];
  }
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 8; k++) sum += y[k] * vec3(c[3 * k], c[3 * k + 1], c[3 * k + 2]);
  return exp(clamp(sum * harmonicStep, -MAX_EXPONENT, MAX_EXPONENT));
}

vec3 lampColour(float id) {
  return 0.5 + 0.5 * cos(6.2831853 * (id * 0.618034 + vec3(0.0, 0.33, 0.67)));
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  int i = at.x + at.y * ${ROW};
  if (i >= num) discard;
  vec4 position = texelFetch(positions, at, 0);
  vec4 axisU = texelFetch(axesU, at, 0);
  vec4 axisV = texelFetch(axesV, at, 0);
  vec3 offset = position.xyz - eye;
  // Along a direction d, 1 / t = d·plane, u = t (d·seenU) and v likewise, with t in lengths of d.
  vec3 normal = cross(axisU.xyz, axisV.xyz);
  vec3 plane = normal / dot(offset, normal);
  outU = vec4(axisU.xyz - dot(offset, axisU.xyz) * plane, 0.0);
  outV = vec4(axisV.xyz - dot(offset, axisV.xyz) * plane, 0.0);
  outPlane = vec4(plane, position.w);
  vec3 shown = texelFetch(radiances, at, 0).rgb;
  vec4 albedo = texelFetch(albedos, at, 0);
  albedo.rgb *= maxAlbedo * albedo.rgb;
  float emission = axisU.w;
  int lamp = int(axisV.w + 0.5);
  if (layer == 0) {
    if (hasHarmonics) shown *= factor(i, normalize(offset));
    if (highlighted > 0 && lamp == highlighted) shown += vec3(0.0, 0.35, 1.0);
  } else if (layer == 1) {
    shown = albedo.rgb;
  } else if (layer == 2) {
    shown = normalize(normal) * (dot(offset, normal) > 0.0 ? -1.0 : 1.0);
  } else if (layer == 3) {
    shown = vec3(emission);
  } else {
    vec3 grey = vec3(0.02 + 0.25 * dot(albedo.rgb, vec3(0.33333)));
    shown = lamp > 0 && emission > 0.1 ? lampColour(float(lamp)) : grey;
  }
  // What is selected.
  if (albedo.a > 0.5 && layer != 2) shown = 0.4 * min(shown, vec3(0.5)) + vec3(0.55, 0.22, 0.0);
  outShown = vec4(shown, 1.0);
}`;
}

/**
 * Rays of pixels through the list of their tile. Lists are in order of the distances of centres;
 * a window of \`window\` hits that wait, the nearest of which is blended when another comes, brings
 * hits into their own order.
 */
export function traceShader(model: Record<string, number>, window: number, pick: boolean): string {
  const constant = (name: string) => model[name].toExponential();
  // Unrolled, of scalars: software graphics keep arrays in memory.
  const each = (line: (k: number) => string, backwards = false) => {
    const lines = Array.from({ length: window }, (_, k) => line(k));
    return (backwards ? lines.reverse() : lines).join("\n");
  };
  return `${HEAD}${LIST}
uniform sampler2D seenU, seenV, seenPlane, seenShown;
uniform usampler2D starts, entries;
uniform vec3 base, stepX, stepY;
uniform int tile, tilesX;
uniform vec2 pickAt;

layout(location = 0) out vec4 result;

const float MAX_RADIUS_2 = ${(model.MAX_RADIUS ** 2).toExponential()};
const float MIN_ALPHA = ${constant("MIN_ALPHA")};
const float MIN_WEIGHT = ${constant("MIN_WEIGHT")};
const float MIN_TRANSMITTANCE = ${constant("MIN_TRANSMITTANCE")};

vec3 sum = vec3(0.0);
float transmittance = 1.0;
float picked = -1.0, pickedWeight = 0.0, depth = 0.0;

void blend(float t, vec2 hit) {
  float weight = transmittance * hit.x;
  if (weight < MIN_WEIGHT) return;
  sum += weight * texelFetch(seenShown, place(int(hit.y)), 0).rgb;
  transmittance *= 1.0 - hit.x;
  ${pick ? "depth += weight * t; if (weight > pickedWeight) { pickedWeight = weight; picked = hit.y; }" : ""}
}

void main() {
  vec2 pixel = ${pick ? "pickAt" : "gl_FragCoord.xy"};
  ivec2 at = ivec2(pixel) / tile;
  int index = at.y * tilesX + at.x;
  int entry = int(texelFetch(starts, place(index), 0).r);
  int end = int(texelFetch(starts, place(index + 1), 0).r);
  vec3 direction = base + stepX * pixel.x + stepY * pixel.y;
  // Farthest first; (opacity, disc), a distance below 0 where there is no hit.
${each((k) => `  float t${k} = -1.0; vec2 hit${k} = vec2(0.0);`)}
  for (; entry < end && transmittance >= MIN_TRANSMITTANCE; entry++) {
    int disc = int(texelFetch(entries, place(entry), 0).r);
    ivec2 where = place(disc);
    vec4 plane = texelFetch(seenPlane, where, 0);
    float inverse = dot(direction, plane.xyz);
    // Discs seen more edge-on than the model allows are not left out: they are thinner than a ray.
    if (!(inverse > 0.0)) continue;
    float u = dot(direction, texelFetch(seenU, where, 0).xyz);
    float v = dot(direction, texelFetch(seenV, where, 0).xyz);
    float t = 1.0 / inverse;
    float r2 = (u * u + v * v) * t * t;
    if (!(r2 <= MAX_RADIUS_2)) continue;
    float alpha = plane.w * exp(-0.5 * r2);
    if (alpha < MIN_ALPHA) continue;
    vec2 hit = vec2(alpha, float(disc));
    bool farther;
    float nearer;
    vec2 other;
${each(
  (k) => `    farther = t > t${k}; nearer = min(t, t${k}); t${k} = max(t, t${k}); t = nearer;
    other = hit${k}; hit${k} = farther ? hit : other; hit = farther ? other : hit;`,
)}
    if (t > 0.0) blend(t, hit);
  }
${each((k) => `  if (t${k} > 0.0 && transmittance >= MIN_TRANSMITTANCE) blend(t${k}, hit${k});`, true)}
  float alpha = 1.0 - transmittance;
  result = ${pick ? "vec4(picked, alpha > 0.0 ? depth / alpha * length(direction) : -1.0, alpha, pickedWeight)" : "vec4(sum, alpha)"};
}`;
}

/** Exposure, tone map and sRGB; on the right of \`split\` (pixels) the photograph. */
export const DISPLAY = `${HEAD}
uniform sampler2D picture, photograph;
uniform ivec2 size;
uniform int antialias, layer, toneMap;
uniform vec3 curveA, curveB;
uniform float exposure, split;
out vec4 result;

vec3 srgb(vec3 v) {
  return mix(12.92 * v, 1.055 * pow(max(v, vec3(1e-9)), vec3(1.0 / 2.4)) - 0.055,
    step(vec3(0.0031308), v));
}
vec3 linear(vec3 v) {
  return mix(v / 12.92, pow((v + 0.055) / 1.055, vec3(2.4)), step(vec3(0.04045), v));
}

// AgX by Troy Sobotka, base look, as eagpt_scene::tonemap has it.
float sigmoid(float x) {
  const vec2 pivot = vec2(10.0 / 16.5, 0.5);
  bool toe = x < pivot.x;
  float width = toe ? pivot.x : 1.0 - pivot.x;
  float height = toe ? pivot.y : 1.0 - pivot.y;
  float power = toe ? 3.0 : 3.25;
  float bend = pow(2.0 * width / height, power) - 1.0;
  float along = abs(x - pivot.x) / width;
  return pivot.y + 2.0 * (x - pivot.x) / pow(1.0 + bend * pow(along, power), 1.0 / power);
}
vec3 agx(vec3 light) {
  const mat3 inset = mat3(0.8424011, 0.04240107, 0.04240107, 0.0784365, 0.8784365, 0.0784365,
    0.07916243, 0.07916243, 0.8791624);
  vec3 v = (clamp(log2(max(inset * light, vec3(1e-12))), -12.4739312, 4.0260688) + 12.4739312) / 16.5;
  v = inverse(inset) * vec3(sigmoid(v.x), sigmoid(v.y), sigmoid(v.z));
  return pow(clamp(v, 0.0, 1.0), vec3(2.2));
}

vec3 shown(vec3 light) {
  light = min(max(light, vec3(0.0)), vec3(1e15));
  if (toneMap == 0) return min(light, vec3(1.0));
  if (toneMap == 1) {
    return clamp((light * light * curveA.x + light * curveA.y + curveA.z)
      / (light * light * curveB.x + light * curveB.y + curveB.z), 0.0, 1.0);
  }
  if (toneMap == 2) {
    return clamp(light / (1.0 + dot(light, vec3(0.2126, 0.7152, 0.0722))), 0.0, 1.0);
  }
  return agx(light);
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  at.y = size.y - 1 - at.y;
  vec3 light = vec3(0.0);
  if (float(at.x) >= split) {
    vec3 stored = linear(texture(photograph, (vec2(at) + 0.5) / vec2(size)).rgb);
    light = stored / max(1.0 - stored, vec3(1.0 / 512.0));
  } else {
    for (int y = 0; y < antialias; y++) {
      for (int x = 0; x < antialias; x++) {
        light += texelFetch(picture, antialias * at + ivec2(x, y), 0).rgb;
      }
    }
    light /= float(antialias * antialias);
    if (layer == 2) {
      float norm = length(light);
      result = vec4(norm > 0.0 ? 0.5 * light / norm + 0.5 : vec3(0.5), 1.0);
      return;
    }
    if (layer == 3) {
      result = vec4(light, 1.0);
      return;
    }
    if (layer != 0) {
      result = vec4(srgb(clamp(light, 0.0, 1.0)), 1.0);
      return;
    }
  }
  result = vec4(srgb(shown(light * exp2(exposure))), 1.0);
}`;
