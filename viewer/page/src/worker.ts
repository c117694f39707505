// The worker: orders and bins discs for a camera, so that the page stays quick.

import { Binner, type Discs, type Pinhole } from "./bins.ts";

export interface BinRequest {
  id: number;
  camera: Pinhole;
  tile: number;
}

export interface BinReply {
  id: number;
  starts: Uint32Array;
  entries: Uint32Array;
  numVisible: number;
  milliseconds: number;
}

let binner: Binner | null = null;

self.onmessage = (event: MessageEvent<{ discs: Discs } | BinRequest>) => {
  const message = event.data;
  if ("discs" in message) {
    binner = new Binner(message.discs);
    return;
  }
  if (!binner) throw new Error("bins are asked for before there are discs");
  const started = performance.now();
  const { starts, entries, numVisible } = binner.fill(message.camera, message.tile);
  const milliseconds = performance.now() - started;
  const reply: BinReply = { id: message.id, starts, entries, numVisible, milliseconds };
  const options = { transfer: [starts.buffer as ArrayBuffer, entries.buffer as ArrayBuffer] };
  (self as unknown as Worker).postMessage(reply, options);
};
