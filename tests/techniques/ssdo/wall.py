"""Wall that emits beside a black floor: the G-buffers of cameras, and irradiance in closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime

from ...closed_forms import Quad, lit_by_wall, quads

Doubles = NDArray[np.float64]

WALL: Quad = ((0, 0, -0.5), (0, 1, 0), (0, 0, 1))
FLOOR: Quad = ((0, 0, -1.5), (0, 0, 3), (3, 0, 0))
LOW, HIGH = np.array([0.35, 0.0, -0.15]), np.array([0.55, 0.35, 0.15])
"""Corners of a black box in front of the wall."""


def quads_of(*parts: Quad) -> Scene:
    """Return parallelograms with the normals that the order of their edges gives."""
    normals = [np.cross(first, second) / np.linalg.norm(np.cross(first, second)) for _, first, second in parts]
    return replace(quads(*parts), normals=np.repeat(normals, 4, axis=0).astype(np.float32))


def box() -> list[Quad]:
    """Return the five visible sides of the box."""
    x, y, z = np.diag(HIGH - LOW)
    return [
        (tuple(LOW), tuple(z), tuple(y)),
        (tuple(LOW + x), tuple(y), tuple(z)),
        (tuple(LOW), tuple(y), tuple(x)),
        (tuple(LOW + z), tuple(x), tuple(y)),
        (tuple(LOW + y), tuple(z), tuple(x)),
    ]


def seen(scene: Scene, camera: Camera, runtime: Runtime) -> GBuffer:
    """Return the G-buffer of a black scene whose wall emits radiance 1."""
    gbuffer = gi.rasterize.gbuffer(scene, camera, runtime=runtime)
    on_wall = np.abs(positions(gbuffer)[..., 0]) < 1e-3
    return emitting(gbuffer, on_wall & (positions(gbuffer)[..., 1] > 1e-3))


def emitting(gbuffer: GBuffer, bright: NDArray[np.bool_]) -> GBuffer:
    """Return a black G-buffer that emits radiance 1 at some pixels [rows, columns]."""
    emission = np.repeat(bright[..., None], 3, axis=-1).astype(np.float32)
    return replace(gbuffer, albedo=np.zeros_like(emission), emission=emission)


def positions(gbuffer: GBuffer) -> Doubles:
    """Return [rows, columns, 3] world positions, NaN where nothing is."""
    depth = np.asarray(gbuffer.depth)
    found = gbuffer.camera.unproject(np.where(np.isfinite(depth), depth, 1.0).astype(np.float32))
    return np.where(np.isfinite(depth)[..., None], found, np.nan)


def floor_of(gbuffer: GBuffer, *, boxed: bool = False, nearest: float = 1e-5) -> tuple[NDArray[np.bool_], Doubles]:
    """Return the pixels of the floor [rows, columns], and their irradiance by the wall [n], W/m^2.

    Pixels that are nearer to the wall than `nearest`, in scene units, are left out.
    """
    position = positions(gbuffer)
    on_floor = (np.abs(position[..., 1]) < 1e-3) & (position[..., 0] > nearest)
    position = position[on_floor]
    x, z = position[:, 0], position[:, 2]
    if not boxed:
        return on_floor, math.pi * lit_by_wall(x, 0.5 + z, 0.5 - z, 1.0)
    # The box occludes some of the rays to 64 x 64 parts of the wall.
    part = (np.arange(64) + 0.5) / 64
    y, along = (each.ravel() for each in np.meshgrid(part, part - 0.5))
    total = np.zeros(len(position))
    for height, shift in zip(y, along, strict=True):
        way = np.stack([-x, np.full(x.shape, height), shift - z], axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort(np.stack([(LOW - position) / way, (HIGH - position) / way]), axis=0)
        enters, leaves = ends[0].max(axis=-1), ends[1].min(axis=-1)
        free = (enters >= leaves) | (leaves <= 0.0) | (enters >= 1.0)
        square = np.sum(way**2, axis=-1)
        total += np.where(free, height * x / square**2, 0.0) / 64**2
    return on_floor, total
