// Pictures compared, as 8-bit sRGB.
import { PNG } from "pngjs";

export const decode = (bytes) => PNG.sync.read(bytes);

export function decodeUri(uri) {
  return decode(Buffer.from(uri.slice(uri.indexOf(",") + 1), "base64"));
}

/** dB; pictures of different sizes have none. */
export function psnr(a, b) {
  if (a.width !== b.width || a.height !== b.height) {
    throw new Error(`${a.width} × ${a.height} and ${b.width} × ${b.height} pixels`);
  }
  let sum = 0;
  for (let i = 0; i < a.data.length; i += 4) {
    for (let k = 0; k < 3; k++) sum += (a.data[i + k] - b.data[i + k]) ** 2;
  }
  const mean = sum / (3 * a.width * a.height);
  return mean === 0 ? Infinity : 10 * Math.log10(255 ** 2 / mean);
}
