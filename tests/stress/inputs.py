"""Random inputs within what is allowed, at its ends: strategies of hypothesis.

Shapes and kinds are drawn one by one, so that a failure shrinks to the simplest; the numbers of an
array come from a generator that is seeded by what was drawn.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.techniques.rsm.rsm_samples import cube_turns

Floats = NDArray[np.float32]
Shape = tuple[int, ...]

SIZES = ((1, 1), (1, 17), (5, 3), (2, 64), (33, 2), (12, 33))
"""(rows, columns): less than a vector, and no multiple of one."""
LONG = ((3, 4099), (4099, 3))
"""Thousands of them; drawn once in ten times, since they take as long as all others together."""
MARGINS = ((0, 0), (1, 2), (4, 6))
DEPTHS = ("plain", "same", "grazing", "ratio", "wild", "tiny", "huge")
NORMALS = ("unit", "none", "zero", "axis", "wild", "tiny")
EYES = ("perspective", "orthographic", "far", "wide", "narrow")
HDR = 20.0
"""Radiance, flux and intensity lie between 10^-HDR and 10^HDR."""

seeds = st.integers(0, 2**32 - 1)


def depth_of(rng: np.random.Generator, shape: Shape, kind: str) -> Floats:
    """Return depths without end or beginning: whatever a float32 above 0 may be."""
    match kind:
        case "same":
            depth = np.full(shape, 10.0 ** rng.uniform(-20.0, 20.0))
        case "grazing":  # a plane at 89.99 degrees
            run = np.linspace(0.0, 1.0, shape[1]) * math.tan(math.radians(89.99))
            depth = np.broadcast_to(1.0 + run, shape)
        case "ratio":  # of 1e9 within a tile
            depth = np.where(rng.random(shape) < 0.5, 1e-4, 1e5)
        case "wild":
            depth = 10.0 ** rng.uniform(-30.0, 30.0, shape)
        case "tiny":
            depth = 10.0 ** rng.uniform(-44.0, -37.0, shape)
        case "huge":
            depth = 10.0 ** rng.uniform(36.0, 38.5, shape)
        case _:
            depth = 1.0 + 0.1 * rng.random(shape) + 5.0 * (rng.random(shape) < 0.1)
    return np.maximum(depth, 1e-45).astype(np.float32)


def normal_of(rng: np.random.Generator, shape: Shape, kind: str) -> Floats | None:
    """Return normals of any length."""
    normal = rng.standard_normal((*shape, 3))
    match kind:
        case "none":
            return None
        case "zero":
            normal *= rng.random((*shape, 1)) < 0.5
        case "axis":
            normal = np.eye(3)[rng.integers(0, 3, shape)] * rng.choice([-1, 1], (*shape, 1))
        case "wild":
            normal *= 10.0 ** rng.uniform(-37.0, 37.0, (*shape, 1))
        case "tiny":
            normal *= 1e-42
    return normal.astype(np.float32)


def hdr(rng: np.random.Generator, shape: Shape) -> Floats:
    """Return [..., 3] of either nothing or 10^-HDR to 10^HDR."""
    lit = rng.random((*shape[:-1], 1)) < 0.8
    return (10.0 ** rng.uniform(-HDR, HDR, shape) * lit).astype(np.float32)


def camera_of(rng: np.random.Generator, size: tuple[int, int], kind: str) -> Camera:
    """Return a camera somewhere that looks anywhere."""
    rows, columns = size
    eye, way = rng.standard_normal((2, 3))
    if kind == "orthographic":
        return Camera.orthographic(
            eye, eye + way, view_height=10.0 ** rng.uniform(-6.0, 6.0), width=columns, height=rows
        )
    if kind == "far":
        eye, way = 1e6 * eye, 1e3 * way
    yfov = {"wide": 3.1, "narrow": 0.001}.get(kind, 0.9)
    return Camera.look_at(eye, eye + way, yfov=yfov, width=columns, height=rows)


@st.composite
def gbuffers(draw: Any) -> GBuffer:
    """Draw a G-buffer."""
    size, margin = draw(st.sampled_from(3 * SIZES + LONG)), draw(st.sampled_from(MARGINS))
    depths, normals = draw(st.sampled_from(DEPTHS)), draw(st.sampled_from(NORMALS))
    eye, layers = draw(st.sampled_from(EYES)), draw(st.integers(1, 2))
    nothing = draw(st.sampled_from((0.0, 0.5, 0.95, 1.0)))
    deep, glows, thick = draw(st.booleans()), draw(st.booleans()), draw(st.booleans())
    rng = np.random.default_rng(draw(seeds))
    shape = (size[0] + 2 * margin[0], size[1] + 2 * margin[1])
    depth = np.sort([depth_of(rng, shape, depths) for _ in range(layers)], axis=0)
    depth[rng.random(depth.shape) < nothing] = np.inf
    depth = np.sort(depth, axis=0)
    whole = (layers, *shape) if deep and layers > 1 else shape
    return GBuffer(
        camera=camera_of(rng, size, eye),
        depth=depth if layers > 1 else depth[0],
        normal=normal_of(rng, whole, normals),
        albedo=rng.random((*whole, 3)) * rng.choice([0.0, 1e-20, 1.0]),
        emission=hdr(rng, (*whole, 3)) if glows else None,
        thickness=10.0 ** rng.uniform(-30.0, 38.0, shape) if thick else None,
    )


@st.composite
def lights(draw: Any) -> list[Light]:
    """Draw one or two lights."""
    kinds = draw(st.lists(st.sampled_from(("point", "spot", "sun", "sky", "image")), min_size=1, max_size=2))
    rng = np.random.default_rng(draw(seeds))
    made: list[Light] = []
    for kind in kinds:
        at, way = rng.standard_normal((2, 3))
        at *= 10.0 ** rng.uniform(-6.0, 6.0)
        power, size = 10.0 ** rng.uniform(-HDR, HDR, 3), 10.0 ** rng.uniform(-10.0, 10.0)
        match kind:
            case "point":
                made.append(PointLight(at, power, radius=size * rng.choice([0.0, 1.0])))
            case "spot":
                made.append(SpotLight(at, way, rng.uniform(1e-4, 1.5), power))
            case "sun":
                made.append(DirectionalLight(way, power, angle=rng.choice([0.0, 0.3])))
            case "sky":
                made.append(Environment(power))
            case _:
                made.append(Environment(10.0 ** rng.uniform(-HDR, HDR, (4, 8, 3))))
    return made


@st.composite
def maps(draw: Any) -> ReflectiveShadowMap:
    """Draw the map of a light."""
    kind, side = draw(st.sampled_from(("spot", "sun", "point"))), draw(st.sampled_from((1, 4, 16)))
    depths = draw(st.sampled_from(DEPTHS[:-2]))
    rng = np.random.default_rng(draw(seeds))
    at, way = rng.standard_normal((2, 3))
    light: SpotLight | DirectionalLight | PointLight
    square = {"width": side, "height": side}
    if kind == "spot":
        light = SpotLight(at, way, 0.7, 1.0)
        cameras = [Camera.look_at(at, at + way, yfov=1.4, **square)]
    elif kind == "sun":
        light, high = DirectionalLight(way, 1.0), 10.0 ** rng.uniform(-3.0, 3.0)
        cameras = [Camera.orthographic(at, at + way, view_height=high, **square)]
    else:
        light, cameras = PointLight(at, 1.0), []
        face = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=0.5 * math.pi, **square)
        for turn in cube_turns():
            view = np.eye(4)
            view[:3, :3], view[:3, 3] = turn, -turn @ at
            cameras.append(Camera(view=view, projection=face.projection, **square))
    shape = (side * len(cameras), side)
    depth = depth_of(rng, shape, depths)
    depth[rng.random(shape) < 0.3] = np.inf
    there = np.isfinite(depth)[..., None]
    near = np.where(there[..., 0], depth, 1.0)
    faces = zip(cameras, near.reshape(len(cameras), side, side), strict=True)
    position = np.concatenate([camera.unproject(face) for camera, face in faces])
    normal = rng.standard_normal((*shape, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return ReflectiveShadowMap(
        light=light,
        camera=tuple(cameras) if len(cameras) > 1 else cameras[0],
        depth=depth,
        position=position * there,
        normal=normal * there,
        flux=hdr(rng, (*shape, 3)),
    )


radii = st.sampled_from((0.5, 1e-10, 1e-3, 30.0, 1e10))
"""Scene units."""
