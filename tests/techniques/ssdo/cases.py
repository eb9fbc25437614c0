"""Shared parts of the SSDO tests: G-buffers on the device, and results in the form of the references."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.ssdo.ssdo_points import Gathered

from ..analytic import camera, scene

ROUNDING = 1e-4
"""Error of A, and of irradiance from radiance and sky up to 1, with directions: sums of 16 terms in
float32, and, as published, a fade-out that multiplies a rounding of some 1e-6 radii by 7."""


def aside(kind: str, size: tuple[int, int] = (31, 41)) -> Camera:
    """Return a camera beside that of the test scenes."""
    return camera(kind, size=size, eye=(-2.5, 2.2, 3.0))


def layered(made: Camera, seed: int | np.random.Generator, margin: tuple[int, int] = (0, 0)) -> GBuffer:
    """Return the layer of balls that a camera sees, and behind it that of a corner."""
    rng = np.random.default_rng(seed)
    front, behind = (scene(name, made, rng, margin=margin) for name in ("bumpy", "corner"))
    depth, deep = np.asarray(front.depth), np.asarray(behind.depth)
    deep = np.where(deep > depth + 1e-3, deep, np.inf)
    return GBuffer(
        camera=made,
        depth=np.stack([depth, deep]),
        normal=np.stack([np.asarray(front.normal), np.asarray(behind.normal)]),
    )


def radiance_of(gbuffer: GBuffer, rng: np.random.Generator) -> NDArray[np.float32]:
    """Return random radiance [layers, rows, columns, 3], 0 where nothing is."""
    depth = np.asarray(gbuffer.depth).reshape(gbuffer.layers, *np.shape(gbuffer.depth)[-2:])
    return np.where(np.isfinite(depth)[..., None], rng.random((*depth.shape, 3)), 0.0).astype(np.float32)


def uploaded(runtime: Runtime, gbuffer: GBuffer) -> DeviceGBuffer:
    """Return the G-buffer on the device."""
    attributes = 1 if np.ndim(gbuffer.normal) < 4 else gbuffer.layers
    device = DeviceGBuffer(runtime, gbuffer.size, layers=gbuffer.layers, margin=gbuffer.margin, attributes=attributes)
    device.upload(gbuffer)
    return device


def planar(runtime: Runtime, radiance: NDArray[np.floating]) -> Plane:
    """Return radiance [layers, rows, columns, 3] on the device."""
    images = np.moveaxis(radiance, -1, 1).reshape(-1, *radiance.shape[1:3])
    plane = runtime.plane(len(images), radiance.shape[1:3])
    plane.upload(images.astype(np.float32))
    return plane


def masks_of(runtime: Runtime, masks: DeviceArray, slices: int, size: tuple[int, int]) -> NDArray[np.uint32]:
    """Return masks in the layout of a plane as [slices, rows, columns]."""
    pitch = runtime.plane(1, size).pitch
    rows = masks.download().reshape(-1, pitch)[1 : 1 + slices * size[0], : size[1]]
    return rows.reshape(slices, *size).view(np.uint32)


def as_gathered(images: NDArray[np.float32], *, sky: bool, bounce: bool) -> Gathered:
    """Return the images of `SsdoPoints.run` in the form of the reference, without `met`."""
    nothing = np.zeros((*images.shape[1:], 3))
    return Gathered(
        images[0].astype(np.float64),
        np.moveaxis(images[1:4], 0, -1) if sky else nothing,
        np.moveaxis(images[-3:], 0, -1) if bounce else nothing,
        np.zeros((0, *images.shape[1:]), bool),
    )


def assert_alike(found: Gathered, expected: Gathered, flips: float) -> None:
    """Check that both are the same up to roundings, except for a share `flips` of the pixels."""
    for name in ("visibility", "sky", "bounce"):
        a, b = getattr(found, name), getattr(expected, name)
        assert np.isfinite(a).all()
        off = np.abs(a - b) > ROUNDING * np.maximum(1.0, np.abs(b))
        assert np.mean(off) <= flips, name
