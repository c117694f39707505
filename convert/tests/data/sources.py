"""Small sources in the layouts of FIPT, Eyeful Tower, nerfstudio and instant-NGP, and what their cameras are.

Writes a folder for each (text only: the tests put images beside) and expected.json. Everything is
computed here with numpy from the published conventions of the formats, by no code of this project.

    pip install numpy && python sources.py
"""

import json
import pathlib

import numpy as np

HERE = pathlib.Path(__file__).parent
rng = np.random.default_rng(7)
expected = {}


def rotation():
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else q[:, [1, 0, 2]]


def directions(n=12):
    """Points in camera space, x right, y down, z forward, within some 25 degrees of the axis."""
    xy = rng.uniform(-0.45, 0.45, size=(n, 2))
    return np.column_stack([xy, np.ones(n)]) * rng.uniform(0.5, 4.0, size=(n, 1))


def opencv(points, f, c, k=(0, 0, 0), p=(0, 0)):
    """OpenCV's perspective model."""
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    return radial_tangential(x, y, f, c, k, p)


def fisheye(points, f, c, k=(0, 0, 0, 0), p=(0, 0)):
    """Equidistant: the angle from the axis is the radius, to which the polynomials are applied."""
    rho = np.hypot(points[:, 0], points[:, 1])
    theta = np.arctan2(rho, points[:, 2])
    scale = np.where(rho > 0, theta / np.maximum(rho, 1e-300), 1 / points[:, 2])
    return radial_tangential(points[:, 0] * scale, points[:, 1] * scale, f, c, k, p)


def radial_tangential(x, y, f, c, k, p):
    r2 = x * x + y * y
    radial = 1 + sum(k_i * r2 ** (i + 1) for i, k_i in enumerate(k))
    xd = x * radial + 2 * p[0] * x * y + p[1] * (r2 + 2 * x * x)
    yd = y * radial + p[0] * (r2 + 2 * y * y) + 2 * p[1] * x * y
    return np.column_stack([f[0] * xd + c[0], f[1] * yd + c[1]])


def entry(name, pose, points, pixels, size):
    return {
        "name": name,
        "size": list(size),
        "world_from_camera": pose.tolist(),
        "points_camera": points.tolist(),
        "pixels": pixels.tolist(),
    }


def write(path, text):
    path = HERE / path
    path.parent.mkdir(exist_ok=True)
    path.write_text(text)


def c2w(r, t):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = r, t
    return m


# FIPT: origin, look-at, up; K. Written with six decimals, as its own files are, and read from
# these.
def fipt():
    size, n = (24, 16), 3
    cams, ks, out = [f"{n}"], [f"{n}"], []
    for i in range(n):
        r, t = rotation(), rng.normal(size=3)
        rows = [t, t + 2.5 * r[:, 2], -r[:, 1]]
        lines = [" ".join(f"{v:.6f}" for v in row) for row in rows]
        cams += lines
        origin, target, up = (np.array([float(v) for v in line.split()]) for line in lines)
        at = (target - origin) / np.linalg.norm(target - origin)
        pose = c2w(np.column_stack([np.cross(-up, at), -up, at]), origin)
        k = np.array([[20.5 + i, 0, 12.25], [0, 21.5 + i, 7.75], [0, 0, 1]])
        ks += [" ".join(f"{v:.6f}" for v in row) for row in k]
        points = directions()
        pixels = (k @ (points / points[:, 2:]).T).T[:, :2]
        out.append(entry(f"{i:03d}", pose, points, pixels, size))
    write("fipt/cam.txt", "\n".join(cams) + "\n")
    write("fipt/K_list.txt", "\n".join(ks) + "\n")
    expected["fipt"] = out


# Eyeful Tower: K and T are lists of columns, K for a size whose ratio to the image's differs
# between the axes.
def eyeful(folder, kind, distortion):
    full, size = (5784, 8660), (20, 30)
    scale = np.array(size) / np.array(full)
    krt, out = [], []
    for i in range(3):
        r, t = rotation(), rng.normal(size=3)
        world_to_camera = c2w(r.T, -r.T @ t)
        k = np.array([[4100.0 + i, 0, 2890.5], [0, 4105.0, 4331.25], [0, 0, 1]])
        name = f"1{i}/1{i}_DSC000{i + 1}"
        krt.append(
            {
                "width": full[0],
                "height": full[1],
                "cameraId": name,
                "K": k.T.tolist(),
                "T": world_to_camera.T.tolist(),
                "distortionModel": kind,
                "distortion": distortion,
                "frameId": i,
                "sensorId": str(i),
            }
        )
        points = directions()
        f, c = (k[0, 0], k[1, 1]), (k[0, 2], k[1, 2])
        if kind == "Fisheye":
            pixels = fisheye(points, f, c, distortion[:3], distortion[6:8])
        else:
            k1, k2, p1, p2, k3 = distortion
            pixels = opencv(points, f, c, (k1, k2, k3), (p1, p2))
        # A pixel position is measured from the corner of the image, which is the same for every
        # size.
        out.append(entry(name, np.linalg.inv(world_to_camera), points, pixels * scale, size))
    krt.append({**krt[0], "cameraId": "31/31_DSC0009"})
    write(f"{folder}/cameras.json", json.dumps({"KRT": krt}, indent=1) + "\n")
    splits = {"train": [out[0]["name"], out[1]["name"], "31/31_DSC0009"], "test": [out[2]["name"]]}
    write(f"{folder}/splits.json", json.dumps(splits) + "\n")
    expected[folder] = out


def opengl(r, t):
    """OpenGL's camera axes: y and z of OpenCV's the other way."""
    return c2w(r * np.array([1, -1, -1]), t)


def nerfstudio():
    size = (24, 16)
    frames, out = [], []
    models = [
        ({"k1": -0.12, "k2": 0.03, "p1": 0.002, "p2": -0.001}, "opencv"),
        ({"k1": -0.1, "k2": 0.02, "k3": -0.004, "p1": 0.001, "p2": 0.002}, "opencv"),
        ({}, "opencv"),
        ({"camera_model": "OPENCV_FISHEYE", "k1": 0.03, "k2": -0.01, "k3": 0.002, "k4": -0.0005}, "fisheye"),
        ({"camera_model": "OPENCV_FISHEYE", "distortion_params": [0.02, -0.01, 0.001, 0.0, 0.003, -0.002]}, "fisheye"),
    ]
    for i, (own, kind) in enumerate(models):
        r, t = rotation(), rng.normal(size=3)
        # Intrinsics of the last frame are for an image of twice the size.
        by = 2 if i == 4 else 1
        f, c = (18.0 + i, 18.5 + i), (12.25, 7.75)
        frame = {
            "file_path": f"images/frame_{i + 1:05d}.exr",
            "fl_x": f[0] * by,
            "fl_y": f[1] * by,
            "cx": c[0] * by,
            "cy": c[1] * by,
            "w": size[0] * by,
            "h": size[1] * by,
            **own,
            "transform_matrix": opengl(r, t).tolist(),
        }
        frames.append(frame)
        points = directions()
        if "distortion_params" in own:
            k1, k2, k3, k4, p1, p2 = own["distortion_params"]
        else:
            k1, k2, k3, k4, p1, p2 = (own.get(key, 0.0) for key in ["k1", "k2", "k3", "k4", "p1", "p2"])
        project = fisheye if kind == "fisheye" else opencv
        pixels = project(points, f, c, (k1, k2, k3, k4), (p1, p2))
        out.append(entry(f"frame_{i + 1:05d}", c2w(r, t), points, pixels, size))
    top = {
        "camera_model": "OPENCV",
        "applied_transform": [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0]],
        "ply_file_path": "sparse_pc.ply",
        "train_filenames": [f["file_path"] for f in frames[:3]],
        "val_filenames": [f["file_path"] for f in frames[3:]],
        "frames": frames,
    }
    write("nerfstudio/transforms.json", json.dumps(top, indent=1) + "\n")
    expected["nerfstudio"] = out


def instant_ngp():
    size = (24, 16)
    angle = 1.1
    f = 0.5 * size[0] / np.tan(0.5 * angle)
    frames, out = [], []
    k = (0.05, -0.02)
    for i in range(2):
        r, t = rotation(), rng.normal(size=3)
        frames.append({"file_path": f"./images/{i:04d}", "sharpness": 20.5, "transform_matrix": opengl(r, t).tolist()})
        points = directions()
        out.append(entry(f"{i:04d}", c2w(r, t), points, opencv(points, (f, f), (12.5, 8.25), k), size))
    top = {"camera_angle_x": angle, "k1": k[0], "k2": k[1], "cx": 12.5, "cy": 8.25, "w": 24.0, "h": 16.0, "aabb_scale": 16, "frames": frames}
    write("instant-ngp/transforms.json", json.dumps(top, indent=1) + "\n")
    expected["instant-ngp"] = out


# FIPT's synthetic scenes: a file for each split, frames by number.
def fipt_synthetic():
    size, angle = (24, 16), 0.9
    f = 0.5 * size[0] / np.tan(0.5 * angle)
    out = []
    for split, n in [("train", 2), ("val", 1)]:
        frames = []
        for i in range(n):
            r, t = rotation(), rng.normal(size=3)
            frames.append({"file_path": f"./{split}/{i:03d}", "transform_matrix": opengl(r, t).tolist()})
            points = directions()
            out.append(entry(f"{split}_{i:03d}", c2w(r, t), points, opencv(points, (f, f), (12.0, 8.0)), size))
        write(f"fipt-synthetic-{split}/transforms.json", json.dumps({"camera_angle_x": angle, "frames": frames}, indent=1) + "\n")
    expected["fipt-synthetic"] = out


# Light: gains of the scene, then DCI-P3 with the white D65 to Rec.709, both from their
# chromaticities.
def colour():
    def xyz_from_rgb(primaries):
        white = np.array([0.3127, 0.3290])
        lift = lambda xy: np.array([xy[0] / xy[1], 1.0, (1 - xy[0] - xy[1]) / xy[1]])
        columns = np.column_stack([lift(np.array(p)) for p in primaries])
        return columns * np.linalg.solve(columns, lift(white))

    p3 = xyz_from_rgb([(0.680, 0.320), (0.265, 0.690), (0.150, 0.060)])
    rec709 = xyz_from_rgb([(0.640, 0.330), (0.300, 0.600), (0.150, 0.060)])
    gains = np.diag([0.628143, 1.0, 2.212346])
    stored = rng.uniform(0.2, 3.0, size=(8, 3)).astype(np.float32)
    light = (np.linalg.inv(rec709) @ p3 @ gains @ stored.T.astype(np.float64)).T
    expected["eyeful-kitchen-light"] = {"stored": stored.tolist(), "rec709": light.tolist()}


fipt()
eyeful("eyeful-2", "RadialAndTangential", [-0.06, 0.02, 0.0008, -0.0004, 0.003])
eyeful("eyeful-1", "Fisheye", [0.04, -0.008, 0.001, 0.0, 0.0, 0.0, 0.0006, -0.0009])
nerfstudio()
instant_ngp()
fipt_synthetic()
colour()
write("expected.json", json.dumps(expected, indent=1) + "\n")
