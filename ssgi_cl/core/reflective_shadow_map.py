"""Reflective shadow maps: numpy arrays with the light, and the camera or cameras, that they are of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.immutable import Immutable, frozen
from ssgi_cl.core.lights import PunctualLight


@dataclass(frozen=True, kw_only=True, eq=False)
class ReflectiveShadowMap(Immutable):
    """The surfaces that a light sees, and the flux that every texel reflects. Its arrays are read-only.

    Attributes:
        light: the light whose map this is.
        camera: its camera, or a tuple of six for a point light, whose faces are stacked from top
            to bottom in the arrays.
        depth: [rows, columns] float32, linear depth from the light in scene units; +inf = nothing.
        position: [rows, columns, 3] float32, world space; 0 where nothing is there.
        normal: [rows, columns, 3] float32, world space, unit length; 0 where nothing is there.
        flux: [rows, columns, 3] float32, reflected radiant flux of the texel in W.
        specular_flux: [rows, columns, 3] float32, likewise, what goes into the Phong lobe round
            the mirrored ray of light; or None, as of scenes without gloss.
        gloss: [rows, columns] float32, exponent of that lobe, >= 0; expected with
            `specular_flux`, else None.
    """

    light: PunctualLight
    camera: Camera | tuple[Camera, ...]
    depth: ArrayLike
    position: ArrayLike
    normal: ArrayLike
    flux: ArrayLike
    specular_flux: ArrayLike | None = None
    gloss: ArrayLike | None = None

    def __post_init__(self) -> None:
        depth = checks.plane("depth", self.depth, unit="scene units", low=0.0, above=True, infinite=True)
        heights = sum(camera.height for camera in self.cameras)
        if depth.shape != (heights, self.cameras[0].width):
            raise ValueError(
                f"depth has shape {depth.shape}: expected {(heights, self.cameras[0].width)} "
                "as the light's cameras, stacked"
            )
        object.__setattr__(self, "depth", frozen(depth, self.depth))
        kinds = [("position", 3, -np.inf), ("normal", 3, -np.inf), ("flux", 3, 0.0)]
        if (self.specular_flux is None) != (self.gloss is None):
            raise ValueError("expected both of specular_flux and gloss, or neither")
        if self.gloss is not None:
            kinds += [("specular_flux", 3, 0.0), ("gloss", 0, 0.0)]
        for name, channels, low in kinds:
            given = getattr(self, name)
            array = checks.plane(name, given, channels=channels, low=low)
            shape = (*depth.shape, channels) if channels else depth.shape
            if array.shape != shape:
                raise ValueError(f"{name} has shape {array.shape}: expected {shape}")
            object.__setattr__(self, name, frozen(array, given))

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """The cameras of the faces, one or six."""
        return self.camera if isinstance(self.camera, tuple) else (self.camera,)
