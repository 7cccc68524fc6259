"""What the tests share: a camera, a wall, and a folder of depth images of it."""

import pathlib
import struct
import zlib

import numpy as np
import sidestep

CAMERA = sidestep.Camera(160, 120, 131.25, 131.25, 79.5, 59.5)
# An optical frame (z ahead, x right, y down) a metre above the floor, looking along x.
T_WORLD_CAMERA = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]], float)
MAPPER = {"plugin": "voxel_grid", "resolution_m": 0.05, "size_vox": [100, 100, 40],
          "origin_m": [-1.0, -2.5, 0.0]}
FIELD = {"plugin": "edt", "unknown": "free"}


def depth_of_pillar(ahead_m=1.525, behind_m=4.1):
    """A pillar 0.3 m wide before a wall, both at right angles to the camera's axis."""
    depth_m = np.full((CAMERA.height_px, CAMERA.width_px), behind_m, np.float32)
    half_px = 0.15 / ahead_m * CAMERA.fx_px
    columns = np.arange(CAMERA.width_px) - CAMERA.cx_px
    depth_m[:, np.abs(columns) < half_px] = ahead_m
    return depth_m


def depth_of(T_world_camera, person_m, radius_m, wall_m=0.0):
    """The floor and somebody on it, who is taller than the image; and a wall at that x."""
    u, v = np.meshgrid(np.arange(CAMERA.width_px), np.arange(CAMERA.height_px))
    rays = np.stack([(u - CAMERA.cx_px) / CAMERA.fx_px, (v - CAMERA.cy_px) / CAMERA.fy_px,
                     np.ones(u.shape)], -1) @ T_world_camera[:3, :3].T
    eye_m = T_world_camera[:3, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        floor_m = np.where(rays[..., 2] < 0, -eye_m[2] / rays[..., 2], np.inf)
        behind_m = np.where((rays[..., 0] > 0) & (wall_m > 0),
                            (wall_m - eye_m[0]) / rays[..., 0], np.inf)
        # |eye + t ray - person| = radius, seen from above.
        a = (rays[..., :2] ** 2).sum(-1)
        b = rays[..., :2] @ (eye_m[:2] - person_m)
        under = b ** 2 - a * (((eye_m[:2] - person_m) ** 2).sum() - radius_m ** 2)
        at_m = np.where((under > 0) & (b < 0), (-b - np.sqrt(np.maximum(under, 0))) / a, np.inf)
    depth_m = np.minimum(np.minimum(floor_m, behind_m), at_m)
    return np.where(depth_m < 5.0, depth_m, 0.0).astype(np.float32)


def frame(depth_m, stamp_s=0.0):
    return sidestep.Frame(depth_m, CAMERA, T_WORLD_CAMERA, stamp_s)


def write_png(path, depth_m):
    """16 bits of grey, millimetres."""
    rows = np.round(1000 * depth_m).astype(">u2")
    lines = b"".join(b"\0" + row.tobytes() for row in rows)

    def chunk(kind, data):
        return (struct.pack(">I", len(data)) + kind + data
                + struct.pack(">I", zlib.crc32(kind + data)))

    head = struct.pack(">IIBBBBB", rows.shape[1], rows.shape[0], 16, 0, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head)
                     + chunk(b"IDAT", zlib.compress(lines)) + chunk(b"IEND", b""))


def write_sequence(folder, depths_m):
    """In the layout of 7-Scenes."""
    folder = pathlib.Path(folder)
    matrix = np.array([[CAMERA.fx_px, 0, CAMERA.cx_px], [0, CAMERA.fy_px, CAMERA.cy_px], [0, 0, 1]])
    np.savetxt(folder / "camera-intrinsics.txt", matrix)
    for i, depth_m in enumerate(depths_m):
        write_png(folder / f"frame-{i:06}.depth.png", depth_m)
        np.savetxt(folder / f"frame-{i:06}.pose.txt", T_WORLD_CAMERA)
    return folder
