"""Writes lenses.json and lenses.bin: 1,000 points of every camera model and where COLMAP projects them.

    pip install pycolmap==4.2.1 numpy && python generate.py

lenses.json lists lenses in order: model, id, names of the parameters, width, height, params. lenses.bin has NUM_POINTS records for
each of them, little endian: i16 x y z, in units of 1/8192, and f64 u v, pixels. All points lie where COLMAP's own inverse returns to them.
"""

import json
import struct

import numpy as np
import pycolmap

NUM_POINTS = 250  # for each of the four lenses of a model
UNIT = 8192.0
WIDTH, HEIGHT = 640, 480
F, FX, FY, CX, CY = 420.0, 431.0, 412.0, 325.5, 236.25
# Fisheye lenses: a field of about 170 degrees across.
G, GX, GY = 215.0, 218.0, 211.0

LENSES = {
    "SIMPLE_PINHOLE": [[F, CX, CY], [300, 320, 240], [900, 100, 200], [250.5, 333, 200]],
    "PINHOLE": [[FX, FY, CX, CY], [300, 310, 320, 240], [900, 850, 100, 200], [250, 280, 333, 200]],
    "SIMPLE_RADIAL": [[F, CX, CY, k] for k in (0.0, -0.21, 0.15, -0.05)],
    "RADIAL": [[F, CX, CY, *k] for k in ((-0.3, 0.1), (0.08, -0.02), (0.2, 0.3), (-0.05, -0.02))],
    "OPENCV": [[FX, FY, CX, CY, *k] for k in (
        (0.0023, -0.0037, 3.3e-5, 1.8e-4), (-0.28, 0.09, 1e-3, -2e-3), (0.1, 0.05, -4e-3, 3e-3), (-0.1, 0.0, 0.01, 0.0))],
    "OPENCV_FISHEYE": [[GX, GY, CX, CY, *k] for k in (
        (0, 0, 0, 0), (0.03, -0.01, 0.002, -0.0005), (-0.05, 0.01, 0.0, 0.0), (0.1, 0.02, 0.003, 0.0004))],
    "FULL_OPENCV": [[FX, FY, CX, CY, *k] for k in (
        (-0.2, 0.05, 1e-3, -1e-3, 0.01, 0.02, -0.01, 0.003), (0.3, 0.1, 0, 0, 0.02, 0.4, 0.12, 0.01),
        (1.1, 0.3, -5e-4, 2e-3, 0.01, 1.3, 0.6, 0.05), (-0.05, 0, 2e-3, 2e-3, 0, 0, 0, 0))],
    "FOV": [[FX, FY, CX, CY, w] for w in (1e-5, 0.4, 0.9, 1.2)],
    "SIMPLE_RADIAL_FISHEYE": [[G, CX, CY, k] for k in (0.0, 0.02, -0.04, 0.1)],
    "RADIAL_FISHEYE": [[G, CX, CY, *k] for k in ((0.0, 0.0), (0.03, -0.004), (-0.04, 0.006), (0.1, 0.01))],
    "THIN_PRISM_FISHEYE": [[GX, GY, CX, CY, *k] for k in (
        (0.02, -0.01, 1e-3, -1e-3, 0.001, -1e-4, 2e-3, -1e-3), (-0.03, 0.005, 0, 0, 0, 0, 0, 0),
        (0.05, 0.01, -2e-3, 1e-3, 0, 0, 1e-3, 3e-3), (0, 0, 3e-3, 3e-3, 0, 0, -2e-3, 0))],
    "RAD_TAN_THIN_PRISM_FISHEYE": [[GX, GY, CX, CY, *k] for k in (
        (0.02, -0.01, 2e-3, -3e-4, 2e-5, 0, 1e-3, -1e-3, 1e-3, -2e-4, -1e-3, 3e-4),
        (-0.03, 0.01, -1e-3, 0, 0, 0, 0, 0, 0, 0, 0, 0), (0.05, 0, 0, 0, 0, 0, -2e-3, 1e-3, 0, 0, 0, 0),
        (0, 0, 0, 0, 0, 0, 5e-4, 5e-4, 3e-3, 1e-3, -2e-3, -1e-3))],
    "SIMPLE_DIVISION": [[F, CX, CY, k] for k in (0.0, -0.2, 0.12, -0.6)],
    "DIVISION": [[FX, FY, CX, CY, k] for k in (0.0, -0.3, 0.1, -0.9)],
    "SIMPLE_FISHEYE": [[G, CX, CY], [120, 320, 240], [400, 100, 200], [90, 333, 200]],
    "FISHEYE": [[GX, GY, CX, CY], [120, 130, 320, 240], [400, 420, 100, 200], [90, 95, 333, 200]],
    "EUCM": [[GX, GY, CX, CY, *k] for k in ((0.0, 1.0), (0.5, 1.0), (0.6, 1.1), (0.7, 0.8))],
    "EQUIRECTANGULAR": [[640, 480], [640, 320], [4096, 2048], [1000, 700]],
}


def points_of(camera, rng):
    """Points that COLMAP projects into the image or a little beside it, and finds again."""
    found_points, found_pixels = [], []
    while sum(map(len, found_points)) < NUM_POINTS:
        direction = rng.normal(size=(4 * NUM_POINTS, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        points = np.round(direction * rng.uniform(0.3, 3.0, size=(len(direction), 1)) * UNIT) / UNIT
        pixels = camera.img_from_cam(points, check_cheirality=False)
        size = np.array([camera.width, camera.height])
        inside = np.all((pixels > -0.1 * size) & (pixels < 1.1 * size), axis=1)
        points, pixels = points[inside], pixels[inside]
        unit = points / np.linalg.norm(points, axis=1, keepdims=True)
        for point, pixel, wanted in zip(points, pixels, unit):
            ray = camera.cam_ray_from_img(pixel)
            if ray is None or not np.linalg.norm(ray / np.linalg.norm(ray) - wanted) < 1e-8:
                continue
            found_points.append(point[None])
            found_pixels.append(pixel[None])
    return np.concatenate(found_points)[:NUM_POINTS], np.concatenate(found_pixels)[:NUM_POINTS]


def main():
    rng = np.random.default_rng(1)
    listed, packed = [], bytearray()
    for model, settings in LENSES.items():
        for params in settings:
            width, height = (WIDTH, HEIGHT) if model != "EQUIRECTANGULAR" else map(int, params)
            camera = pycolmap.Camera(model=model, width=width, height=height, params=np.array(params, float))
            listed.append({
                "model": model, "id": int(camera.model), "names": camera.params_info,
                "width": camera.width, "height": camera.height, "params": [float(p) for p in params],
            })
            points, pixels = points_of(camera, rng)
            for point, pixel in zip(points, pixels):
                packed += struct.pack("<3h2d", *np.round(point * UNIT).astype(int), *pixel)
            angle = np.degrees(np.arctan2(np.hypot(points[:, 0], points[:, 1]), points[:, 2]))
            print(f"{model:28} {angle.max():6.1f} degrees off the axis")
    with open("lenses.json", "w") as file:
        file.write("[\n" + ",\n".join(json.dumps(lens) for lens in listed) + "\n]\n")
    with open("lenses.bin", "wb") as file:
        file.write(packed)


if __name__ == "__main__":
    main()
