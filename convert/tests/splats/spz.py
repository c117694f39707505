"""Makes SPZ of a 3DGS PLY: spz.py IN.ply OUT.spz VERSION, 2 or 3.

Written from the public description of the format, as a check of the reader: three.v2.spz and
three.v3.spz are what it makes of three.ply, whose values are random. PLY axes (x right, y down)
become those of the file (x right, y up).
"""
import gzip, struct, sys
import numpy as np
src, dst, version = sys.argv[1], sys.argv[2], int(sys.argv[3])
b = open(src, 'rb').read(); h, body = b.split(b'end_header\n', 1)
names = [l.split()[2].decode() for l in h.splitlines() if l.startswith(b'property')]
n = next(int(l.split()[2]) for l in h.splitlines() if l.startswith(b'element vertex'))
v = np.frombuffer(body, '<f4').reshape(n, len(names)).astype(np.float64)
g = lambda *k: np.stack([v[:, names.index(i)] for i in k], 1)
pos = g('x', 'y', 'z') * [1, -1, -1]
fixed = np.round(pos * 4096).astype(np.int64) & 0xffffff
P = np.stack([fixed & 255, fixed >> 8 & 255, fixed >> 16 & 255], 2).astype(np.uint8).tobytes()
u8 = lambda x: np.clip(np.round(x), 0, 255).astype(np.uint8).tobytes()
A = u8(255 / (1 + np.exp(-g('opacity'))))
C = u8(g('f_dc_0', 'f_dc_1', 'f_dc_2') * 0.15 * 255 + 127.5)
S = u8((g('scale_0', 'scale_1', 'scale_2') + 10) * 16)
w, x, y, z = g('rot_0', 'rot_1', 'rot_2', 'rot_3').T
q = np.stack([x, -y, -z, w], 1); q /= np.linalg.norm(q, axis=1, keepdims=True)
if version == 2:
    q *= np.where(q[:, 3:] < 0, -1, 1); R = u8(q[:, :3] * 127.5 + 127.5)
else:
    out = []
    for c in q:
        i = int(np.argmax(np.abs(c))); c = c if c[i] >= 0 else -c; word = i
        for k in range(4):
            if k != i: word = (word << 10) | ((c[k] < 0) << 9) | int(511 * abs(c[k]) * 2 ** .5 + .5)
        out.append(struct.pack('<I', word))
    R = b''.join(out)
rest = [k for k in names if k.startswith('f_rest_')]; per = len(rest) // 3
deg = {0: 0, 3: 1, 8: 2, 15: 3}[per]
sgn = np.array([-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1])[:per]  # half turn about x
sh = np.stack([g(*[f'f_rest_{c * per + k}' for k in range(per)]) * sgn for c in range(3)], 2) if per else np.zeros((n, 0))
H = u8(sh.reshape(n, -1) * 128 + 128)
open(dst, 'wb').write(gzip.compress(struct.pack('<IIIBBBB', 0x5053474e, version, n, deg, 12, 0, 0) + P + A + C + S + R + H, mtime=0))
print(dst, n, 'Gaussians, degree', deg)
