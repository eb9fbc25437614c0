"""Analytic G-buffers: planes and spheres met by the view ray of every pixel, in float64."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera, look_at_matrix
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime

Doubles = NDArray[np.float64]

EYE = (1.0, 2.0, 4.5)
TARGET = (0.2, 0.4, -0.3)
CAMERAS = ("perspective", "orthographic", "off-centre", "reversed-z", "intrinsics")


def slow_but(values: Iterable[Any], *fast: Any) -> list[Any]:
    """Return values of a parameter of tests, of which the fast tests take those named."""
    return [pytest.param(v, marks=() if v in fast else pytest.mark.slow) for v in values]


def share_off(a: NDArray[Any], b: NDArray[Any], tolerance: float | NDArray[Any]) -> float:
    """Return the share of values that differ by more than `tolerance` (or are not numbers)."""
    return float(np.mean(~(np.abs(a - b) <= tolerance)))


def uploaded(runtime: Runtime, gbuffer: GBuffer) -> DeviceGBuffer:
    """Return a G-buffer in device memory of its own, with the attributes of as many layers."""
    attributes = 1 if np.ndim(gbuffer.normal) < 4 else gbuffer.layers
    device = DeviceGBuffer(runtime, gbuffer.size, layers=gbuffer.layers, margin=gbuffer.margin, attributes=attributes)
    device.upload(gbuffer)
    return device


def check_second_run(runtime: Runtime, run: Callable[[], NDArray[Any]]) -> NDArray[Any]:
    """Check that a second run allocates and builds nothing and gives the bits of the first; return them."""
    first = run()
    before = runtime.allocated_bytes, runtime.builds
    second = run()
    assert (runtime.allocated_bytes, runtime.builds) == before
    np.testing.assert_array_equal(first, second)
    return first


SCENES = ("corner", "ball", "step", "bumpy", "noisy")
TAKEN = [*zip(SCENES, CAMERAS[1:], strict=False), ("bumpy", "perspective")]
VIEWS = [
    pytest.param(name, kind, marks=() if fast else pytest.mark.slow)
    for name in SCENES
    for kind in CAMERAS
    for fast in [name == "noisy" or (name, kind) in TAKEN]
]
"""Every scene with every camera. The fast tests take each scene before a camera of its own, and the
one with holes, noise and rebuilt normals before all."""


def camera(
    name: str = "perspective",
    size: tuple[int, int] = (47, 61),
    *,
    scale: float = 1.0,
    shift: ArrayLike = 0.0,
    eye: ArrayLike = EYE,
    target: ArrayLike = TARGET,
) -> Camera:
    """Return one of `CAMERAS` of `size` = (rows, columns).

    Args:
        scale: of the whole world.
        shift: of the whole world, added after the scale.
    """
    rows, columns = size
    ends = [scale * np.asarray(end) + shift for end in (eye, target)]
    if name == "orthographic":
        return Camera.orthographic(*ends, view_height=4.0 * scale, width=columns, height=rows)
    if name == "intrinsics":
        focal = 1.1 * max(rows, columns)
        return Camera.from_intrinsics(
            focal,
            0.9 * focal,
            0.3 * columns,
            0.6 * rows,
            width=columns,
            height=rows,
            view=look_at_matrix(*ends, (0, 1, 0)),
            near=1e-3 * scale,
        )
    made = Camera.look_at(*ends, width=columns, height=rows, reversed_z=name == "reversed-z")
    if name == "off-centre":
        projection = made.projection.copy()
        projection[0, 2], projection[1, 2] = 0.4, -0.3
        return replace(made, projection=projection)
    return made


@dataclass(frozen=True)
class Plane:
    """The points x with normal . (x - point) = 0, of which the half space `where` may be kept."""

    point: ArrayLike
    normal: ArrayLike
    where: tuple[ArrayLike, float] | None = None
    """(direction, least): only points with direction . x >= least."""

    def meet(self, start: Doubles, along: Doubles) -> tuple[Doubles, Doubles]:
        """Return depth [rows, columns] (+inf where it is missed) and normal."""
        normal = np.asarray(self.normal, np.float64)
        normal = normal / np.linalg.norm(normal)
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = ((np.asarray(self.point) - start) @ normal) / (along @ normal)
            hit = np.isfinite(depth) & (depth > 0.0)
            if self.where is not None:
                hit &= (start + depth[..., None] * along) @ np.asarray(self.where[0]) >= (self.where[1])
        return np.where(hit, depth, np.inf), np.broadcast_to(normal, along.shape)


def _dot(a: Doubles, b: Doubles) -> Doubles:
    """Return the products of vectors, faster than a sum over so short an axis."""
    result: Doubles = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return result


@dataclass(frozen=True)
class Ball:
    """A sphere seen from outside."""

    centre: ArrayLike
    radius: float

    def meet(self, start: Doubles, along: Doubles) -> tuple[Doubles, Doubles]:
        """Return depth [rows, columns] (+inf where it is missed) and normal."""
        to = start - np.asarray(self.centre)
        a, b, c = _dot(along, along), _dot(along, to), _dot(to, to) - self.radius**2
        inside = b * b - a * c
        depth = (-b - np.sqrt(np.maximum(inside, 0.0))) / a
        hit = (inside > 0.0) & (depth > 0.0)
        return np.where(hit, depth, np.inf), (to + depth[..., None] * along) / self.radius


def trace(
    camera: Camera, things: Sequence[Plane | Ball], *, margin: tuple[int, int] = (0, 0), normals: bool = True
) -> GBuffer:
    """Return what `camera` sees of `things`, with a margin of (rows, columns) on every side."""
    shape = (camera.height + 2 * margin[0], camera.width + 2 * margin[1])
    start = camera.unproject(np.zeros(shape, np.float32))
    along = camera.unproject(np.ones(shape, np.float32)) - start  # depth grows by 1
    nearest = np.full(shape, np.inf)
    normal = np.zeros((*shape, 3))
    for thing in things:
        depth, there = thing.meet(start, along)
        nearer = depth < nearest
        nearest = np.where(nearer, depth, nearest)
        normal = np.where(nearer[..., None], there, normal)
    return GBuffer(
        camera=camera, depth=nearest.astype(np.float32), normal=normal.astype(np.float32) if normals else None
    )


def tilted(camera: Camera, degrees: float, *, turn: float = 0.7, distance: float = 5.0) -> Plane:
    """Return a plane `distance` in front of the camera, tilted away from facing it."""
    tilt = np.radians(degrees)
    facing = [np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)]
    ahead = camera.position - distance * camera.view[2, :3]
    return Plane(ahead, np.asarray(facing) @ camera.view[:3, :3])


def scene(
    name: str,
    camera: Camera,
    rng: np.random.Generator,
    *,
    margin: tuple[int, int] = (0, 0),
    scale: float = 1.0,
    shift: ArrayLike = 0.0,
) -> GBuffer:
    """Return one of `SCENES`; `scale` and `shift` move the world as they do in `camera`."""

    def place(*point: float) -> Doubles:
        return scale * np.asarray(point) + shift

    floor = Plane(place(0.0, -0.3, 0.0), (0.0, 1.0, 0.0))
    if name == "corner":
        things: list[Plane | Ball] = [
            floor,
            Plane(place(0.0, 0.0, -1.0), (0.0, 0.0, 1.0)),
            Plane(place(-0.8, 0.0, 0.0), (1.0, 0.0, 0.0)),
        ]
    elif name == "ball":
        things = [floor, Ball(place(0.0, 0.5, 0.0), 0.8 * scale)]
    elif name == "step":
        near = Plane(place(0.0, 0.0, 0.7), (0.1, 0.0, 1.0), ((1.0, 0.0, 0.0), place(0.2)[0]))
        things = [near, Plane(place(0.0, 0.0, -0.6), (0.0, 0.2, 1.0))]
    else:
        centres = rng.uniform((-2.0, -0.5, -2.0), (2.0, 0.6, 2.0), (40, 3))
        sizes = rng.uniform(0.1, 0.5, 40)
        things = [floor]
        things += [Ball(place(*c), r * scale) for c, r in zip(centres, sizes, strict=True)]
    gbuffer = trace(camera, things, margin=margin, normals=name != "noisy")
    if name != "noisy":
        return gbuffer
    depth = gbuffer.first("depth")
    assert depth is not None
    noise = 1.0 + 0.01 * rng.standard_normal(depth.shape)
    holes = rng.random(depth.shape) < 0.02
    return GBuffer(camera=camera, depth=np.where(holes, np.inf, depth * noise).astype(np.float32))


@cache
def view_of(
    name: str, kind: str = "perspective", size: tuple[int, int] = (47, 61), *, margin: tuple[int, int] = (0, 0)
) -> GBuffer:
    """Return one of `SCENES` before one of `CAMERAS`, the same for all tests."""
    return scene(name, camera(kind, size), np.random.default_rng(20), margin=margin)
