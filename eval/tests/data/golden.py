"""Writes golden.json: metrics of a small synthetic pair by other programs.

    pip install flip-evaluator==1.7 numpy scipy scikit-image
    python golden.py

The pair is defined by the integer formulas below, which tests/golden.rs repeats; all its values are exact in float32.
"""

import json
import pathlib

import flip_evaluator
import numpy as np
from scipy.ndimage import gaussian_filter
from skimage.metrics import structural_similarity

WIDTH, HEIGHT = 32, 24
# Every so manieth pixel of an error map is kept.
MAP_STEP = 7


def pair():
    y, x, c = np.mgrid[:HEIGHT, :WIDTH, :3]
    reference = ((x * 7 + y * 3 + c * 11) % 32 + (x // 8 + y // 6) % 2 * 32) / 64
    reference[(x >= 20) & (x < 24) & (y >= 4) & (y < 8)] = 12.5
    noise = ((x * 37 + y * 91 + c * 53) % 17 - 8) / 256
    test = np.maximum(reference + noise, 0)
    test[(x < 6) & (y > 16) & (c == 0)] += 0.25
    return reference.astype(np.float32), test.astype(np.float32)


def srgb(linear):
    linear = np.clip(linear.astype(np.float64), 0, 1)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def pq(linear):
    y = np.maximum(linear.astype(np.float64) / 100, 1e-6) ** (1305 / 8192)
    return ((107 / 128 + 2413 / 128 * y) / (1 + 2392 / 128 * y)) ** (2523 / 32)


def psnr(a, b):
    return float(np.mean(-10 * np.log10(np.mean((a.astype(np.float64) - b) ** 2, axis=(0, 1)))))


def ssim(a, b, border):
    def blur(v):
        return gaussian_filter(v, sigma=1.5, radius=5, axes=(0, 1), mode=border)

    ma, mb = blur(a), blur(b)
    va, vb, cov = blur(a * a) - ma * ma, blur(b * b) - mb * mb, blur(a * b) - ma * mb
    c1, c2 = 0.01**2, 0.03**2
    return (2 * ma * mb + c1) * (2 * cov + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))


def flip(a, b, kind, **parameters):
    error, mean, used = flip_evaluator.evaluate(a, b, kind, applyMagma=False, parameters=parameters)
    found = {"given": parameters, "mean": mean, "map": error.ravel()[::MAP_STEP].astype(float).round(6).tolist()}
    if kind == "HDR":
        found["used"] = used
    return found


def main():
    reference, test = pair()
    a, b = srgb(reference), srgb(test)
    # scikit-image has another border; inside it must agree with the formula used here.
    _, full = structural_similarity(
        a, b, data_range=1, channel_axis=2, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, full=True
    )
    assert np.abs(full - ssim(a, b, "reflect")).max() < 1e-12
    a32, b32 = a.astype(np.float32), b.astype(np.float32)
    black, white = np.zeros_like(a32), np.ones_like(a32)
    golden = {
        "psnr_srgb_db": psnr(a, b),
        "psnr_linear_db": psnr(reference, test),
        "psnr_pq_db": psnr(pq(reference), pq(test)),
        "ssim_srgb": float(ssim(a, b, "constant").mean()),
        "map_step": MAP_STEP,
        "flip_ldr": [flip(a32, b32, "LDR"), flip(a32, b32, "LDR", ppd=40)],
        "flip_ldr_black_white": flip(black, white, "LDR")["mean"],
        "flip_hdr": [
            flip(reference, test, "HDR"),
            flip(reference, test, "HDR", tonemapper="hable"),
            flip(reference, test, "HDR", tonemapper="reinhard", ppd=20),
            flip(reference, test, "HDR", startExposure=-2, stopExposure=1, numExposures=3),
        ],
    }
    path = pathlib.Path(__file__).with_name("golden.json")
    path.write_text(json.dumps(golden, separators=(",", ":")).replace('],', '],\n').replace('},', '},\n') + "\n")


main()
