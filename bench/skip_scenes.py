"""Scenes that need little, for the table of what is left out of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from ssgi_cl.core.lights import DirectionalLight, Environment, Light, SpotLight
from ssgi_cl.core.scene import Material
from ssgi_cl.rasterize.normals import DEFAULT_CREASE_ANGLE
from ssgi_cl.rasterize.parts import Part, assemble
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES, BuiltinScene
from ssgi_cl.rasterize.scenes.generated import generated
from ssgi_cl.rasterize.scenes.scatter import between, rotation
from ssgi_cl.rasterize.scenes.shapes import box, mesh, quad

SUN = DirectionalLight((-0.3, -1.0, -0.4), (3.0, 2.8, 2.5))
SKY = Environment((0.4, 0.5, 0.7))
GLOW = Environment(0.3)
"""A little ambient light, so that ambient occlusion has a purpose indoors."""
LAMPS = 32
LEAVES = 20_000


def _view(
    name: str,
    parts: list[Part],
    lights: tuple[Light, ...],
    eye: tuple[float, float, float],
    target: tuple[float, float, float],
    ao_radius: float,
) -> BuiltinScene:
    scene = assemble(parts, (Material(albedo=(0.7, 0.7, 0.7)),), (), crease_angle=DEFAULT_CREASE_ANGLE)
    return BuiltinScene(
        name=name, scene=scene, eye=eye, target=target, yfov=math.radians(50.0), lights=lights, ao_radius=ao_radius
    )


def _ground() -> Part:
    return quad([(-50, 0, 50), (50, 0, 50), (50, 0, -50), (-50, 0, -50)])


def lone_object() -> BuiltinScene:
    """Make a crate in an empty sky that covers 1 pixel in 35."""
    crate = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    return _view("lone object", [crate], (SUN, SKY), (2.5, 2.0, 5.5), (0.0, 0.0, 0.0), 0.2)


def flat_floor() -> BuiltinScene:
    """Make a floor of 100 m that fills the view."""
    return _view("flat floor", [_ground()], (SUN, SKY), (0.0, 4.0, 8.0), (0.0, 0.0, 2.0), 0.3)


def foliage() -> BuiltinScene:
    """Make leaves of 5 cm, turned any way, in 30 cubic metres, over a floor."""
    count = LEAVES
    leaf = np.array([(-0.025, 0, 0), (0.025, 0, 0), (0.025, 0.05, 0), (-0.025, 0.05, 0)])
    axis = between(1, -1.0, 1.0, count, 3)
    turn = rotation(axis, between(2, 0.0, 2.0 * math.pi, count))
    places = between(3, 0.0, 1.0, count, 3) * [4.0, 2.5, 3.0] - [2.0, 0.0, 1.5]
    corners = np.einsum("nij,vj->nvi", turn, leaf) + places[:, None, :]
    first = 4 * np.arange(count)[:, None]
    triangles = (first[..., None] + np.array([(0, 1, 2), (0, 2, 3)])).reshape(-1, 3)
    leaves = mesh(corners.reshape(-1, 3), triangles, name="leaves")
    return _view("foliage", [_ground(), leaves], (SUN, SKY), (0.0, 1.6, 4.0), (0.0, 1.2, 0.0), 0.2)


def many_lamps() -> BuiltinScene:
    """Make crates on a floor under a light, with more behind the camera that light other things."""
    crates = [box((x - 0.4, 0.0, z - 0.4), (x + 0.4, 0.8, z + 0.4)) for x in (-2, 0, 2) for z in (-2, 0)]
    punctual_lights: list[Light] = [SpotLight((0.0, 5.0, 0.0), (0.0, -1.0, 0.0), 0.8, 60.0)]
    punctual_lights += [
        SpotLight((2.0 * (i - LAMPS // 2 + 1), 4.0, 14.0), (0.0, -0.5, 1.0), 0.5, 60.0) for i in range(LAMPS - 1)
    ]
    return _view("many lights", [_ground(), *crates], (*punctual_lights, GLOW), (0.0, 3.0, 7.0), (0.0, 0.3, 0.0), 0.3)


def closed_room() -> BuiltinScene:
    """Make the Cornell box seen from inside, with ambient light: all pixels show near surfaces."""
    built = BUILTIN_SCENES["cornell_box"]()
    return replace(
        built,
        name="closed room",
        eye=(0.278, 0.273, -0.02),
        target=(0.278, 0.273, 0.28),
        yfov=math.radians(70.0),
        lights=(*built.lights, GLOW),
    )


def hall() -> BuiltinScene:
    """Make the built-in hall: columns, plants and things everywhere."""
    return BUILTIN_SCENES["hall"]()


def unlit() -> BuiltinScene:
    """Make the hall without any light."""
    return replace(hall(), name="unlit", lights=())


SKIP_SCENES: tuple[Callable[[], BuiltinScene], ...] = (
    lone_object,
    flat_floor,
    many_lamps,
    unlit,
    closed_room,
    foliage,
    hall,
)
"""Their makers, the scenes that need least first."""

GENERATED = ("room-7", "colonnade-3", "street-5")

TABLE_SCENES: tuple[Callable[[], BuiltinScene], ...] = (
    *SKIP_SCENES,
    *(make for name, make in BUILTIN_SCENES.items() if name != "hall"),
    *(partial(generated, name) for name in GENERATED),
)
"""Those of the table: also the built-in scenes, and some that are generated."""
