"""The Cornell box, after the data of the Cornell University Program of Computer Graphics.

Geometry and camera: http://www.graphics.cornell.edu/online/box/data.html (millimetres there,
metres here). The reflectances and the light were measured as spectra; the RGB values used here are
those of the "CornellBox-Original" model of the McGuire Computer Graphics Archive, linear.
"""

from __future__ import annotations

import math

import numpy as np

from ssgi_cl.core.lights import SpotLight
from ssgi_cl.core.scene import Material

from ..parts import Part, assemble
from .builtin import BuiltinScene
from .shapes import of_material, quad

_WHITE, _RED, _GREEN, _LIGHT = range(4)
_RADIANCE = (17.0, 12.0, 4.0)  # W m^-2 sr^-1
_MATERIALS = (
    Material(name="white", albedo=(0.725, 0.71, 0.68)),
    Material(name="red", albedo=(0.63, 0.065, 0.05)),
    Material(name="green", albedo=(0.14, 0.45, 0.091)),
    Material(name="light", albedo=(0.78, 0.78, 0.78), emission=_RADIANCE),
)

# Corners in millimetres, counter-clockwise seen from inside the room (outside of the blocks).
_ROOM = (
    (_WHITE, ((552.8, 0, 0), (0, 0, 0), (0, 0, 559.2), (549.6, 0, 559.2))),
    (_WHITE, ((556, 548.8, 0), (556, 548.8, 559.2), (0, 548.8, 559.2), (0, 548.8, 0))),
    (_WHITE, ((549.6, 0, 559.2), (0, 0, 559.2), (0, 548.8, 559.2), (556, 548.8, 559.2))),
    (_GREEN, ((0, 0, 559.2), (0, 0, 0), (0, 548.8, 0), (0, 548.8, 559.2))),
    (_RED, ((552.8, 0, 0), (549.6, 0, 559.2), (556, 548.8, 559.2), (556, 548.8, 0))),
)
_LIGHT_X, _LIGHT_Z, _CEILING = (213.0, 343.0), (227.0, 332.0), 548.8
_LIGHT_DROP = 1.0
"""Millimetres: measured in the ceiling's plane, the light would flicker with it."""

# The four upper corners of each block, counter-clockwise seen from above.
_BLOCKS = (
    (165.0, ((130, 65), (82, 225), (240, 272), (290, 114))),
    (330.0, ((423, 247), (265, 296), (314, 456), (472, 406))),
)


def cornell_box() -> BuiltinScene:
    """Make the Cornell box: 32 triangles, the red wall on the left, 0.56 m wide.

    The light is there twice, for renderers that take emission and for those that take lights: as a
    quad of radiance L, and as a spot light just below it. A Lambertian quad of area A sends out a
    flux of pi L A; a cone of half-angle 60 degrees covers pi sr, so that a spot of intensity L A
    sends out the same flux, and the same intensity straight down. Use one of the two.
    """
    parts = [of_material(quad(corners), material) for material, corners in _ROOM]
    (x0, x1), (z0, z1), height = _LIGHT_X, _LIGHT_Z, _CEILING - _LIGHT_DROP
    corners = ((x1, height, z0), (x1, height, z1), (x0, height, z1), (x0, height, z0))
    parts.append(of_material(quad(corners), _LIGHT))
    for top, outline in _BLOCKS:
        parts += _block(top, outline)
    metres = np.diag([1e-3, 1e-3, 1e-3, 1.0])
    scene = assemble([part.transformed(metres) for part in parts], _MATERIALS)
    area = (x1 - x0) * (z1 - z0) * 1e-6
    spot = SpotLight(
        position=(0.5e-3 * (x0 + x1), 1e-3 * (height - 1.0), 0.5e-3 * (z0 + z1)),
        direction=(0.0, -1.0, 0.0),
        cone_angle=math.pi / 3.0,
        intensity=np.array(_RADIANCE) * area,
    )
    return BuiltinScene(
        name="cornell_box",
        scene=scene,
        eye=(0.278, 0.273, -0.8),
        target=(0.278, 0.273, 0.28),
        yfov=2.0 * math.atan(0.5 * 0.025 / 0.035),  # sensor 25 mm, focal length 35 mm
        lights=(spot,),
        lights_stand_in=True,
        ao_radius=0.15,
    )


def _block(top: float, outline: tuple[tuple[float, float], ...]) -> list[Part]:
    """Return the top and the four sides; the bottom stands on the floor and is not seen."""
    sides = [quad([(x, top, z) for x, z in outline])]
    for (x0, z0), (x1, z1) in zip(outline, (*outline[1:], outline[0]), strict=True):
        sides.append(quad([(x0, top, z0), (x0, 0.0, z0), (x1, 0.0, z1), (x1, top, z1)]))
    return sides
