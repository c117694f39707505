// A scene in Spark, measured as the page of the viewer is.
import { SparkRenderer, SplatMesh } from "@sparkjsdev/spark";
import * as THREE from "three";

const started = performance.now();
const canvas = document.getElementById("canvas");
const renderer = new THREE.WebGLRenderer({ canvas, antialias: false, preserveDrawingBuffer: true });
const scene = new THREE.Scene();
// All Gaussians in every frame: levels of detail would be another scene.
const spark = new SparkRenderer({ renderer, enableLod: false });
scene.add(spark);
const splats = new SplatMesh({ url: "scene.ply" });
await splats.initialized;
scene.add(splats);
const loadMs = performance.now() - started;

const camera = new THREE.PerspectiveCamera();
camera.matrixAutoUpdate = false;

function look({ pose, fov }, width, height, aside) {
  renderer.setPixelRatio(1);
  renderer.setSize(width, height, false);
  camera.fov = fov;
  camera.aspect = width / height;
  camera.near = 0.01;
  camera.updateProjectionMatrix();
  // Poses of datasets have OpenGL's axes, as three.js has.
  camera.matrix.set(...pose);
  camera.matrix.elements[12] += aside;
  camera.matrix.decompose(camera.position, camera.quaternion, camera.scale);
  camera.updateMatrixWorld(true);
}

/** A frame that the device has finished: the read needs it. */
function draw() {
  renderer.render(scene, camera);
  const gl = renderer.getContext();
  gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
}

/** Orders the splats for a camera; milliseconds. */
async function sorted(...view) {
  look(...view);
  const from = performance.now();
  await spark.update({ scene, camera });
  while (spark.sorting || spark.sortDirty) await new Promise((resolve) => setTimeout(resolve, 1));
  return performance.now() - from;
}

/** A frame of the splats in their present order; milliseconds. */
function frame() {
  const from = performance.now();
  draw();
  return performance.now() - from;
}

async function picture(view, width, height) {
  for (let i = 0; i < 3; i++) {
    await sorted(view, width, height, 0);
    draw();
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  return canvas.toDataURL("image/png");
}

window.eagptViewer = { loadMs, sorted, frame, picture };
