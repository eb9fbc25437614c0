"""Textures of a scene as Mitsuba 3 has them, and kinds of textures that it lacks."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Material, Scene, Wrap
from ssgi_cl.core.srgb import BYTES

Doubles = NDArray[np.float64]


def glow(mi: Any, scene: Scene, material: Material, factor: Doubles | float = 1.0) -> dict[str, Any]:
    """Return the texture of a material's emission times a factor; white without."""
    if material.emission_texture < 0:
        return {"type": "rgb", "value": [1.0, 1.0, 1.0]}
    texels = scene.textures[material.emission_texture]
    decoded = BYTES[texels[..., :3]]
    return bitmap(mi, decoded * factor, scene.wraps[material.emission_texture])


def bitmap(mi: Any, values: Doubles, wrap: Wrap) -> dict[str, Any]:
    """Return a texture of linear values, row 0 on top at v = 1; bilinear.

    Mitsuba wraps both axes alike. Where they differ, coordinates are wrapped before: at the seams of the one that
    repeats, a texel is held for half its width.
    """
    image = mi.Bitmap(np.ascontiguousarray(values[::-1], np.float32))  # Mitsuba's v = 0 is row 0
    alike = wrap[0] if wrap[0] == wrap[1] else "clamp"
    texture = {"type": "bitmap", "bitmap": image, "raw": True, "wrap_mode": alike}
    if wrap[0] == wrap[1]:
        return texture
    _register_wrapped(mi)
    return {"type": "ssgi_wrapped", "inner": texture, "across": wrap[0], "down": wrap[1]}


def _register_wrapped(mi: Any) -> None:
    dr = importlib.import_module("drjit")

    class Wrapped(mi.Texture):  # type: ignore[misc]
        """A texture whose coordinates are wrapped by a kind of their own along each axis."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.inner, self.kinds = properties["inner"], (properties["across"], properties["down"])

        def _moved(self, si: Any) -> Any:
            moved = mi.SurfaceInteraction3f(si)
            moved.uv = mi.Point2f(*(self._wrapped(si.uv[i], kind) for i, kind in enumerate(self.kinds)))
            return moved

        def _wrapped(self, x: Any, kind: str) -> Any:
            if kind == "mirror":
                twice = x - 2.0 * dr.floor(0.5 * x)
                return dr.minimum(twice, 2.0 - twice)
            return x - dr.floor(x) if kind == "repeat" else x

        def eval(self, si: Any, active: Any = True) -> Any:
            return self.inner.eval(self._moved(si), active)

        def eval_1(self, si: Any, active: Any = True) -> Any:
            return self.inner.eval_1(self._moved(si), active)

        def is_spatially_varying(self) -> bool:
            return True

    mi.register_texture("ssgi_wrapped", Wrapped)


def register_product(mi: Any) -> None:
    class Product(mi.Texture):  # type: ignore[misc]
        """The product of two textures, which Mitsuba lacks."""

        def __init__(self, properties: Any) -> None:
            super().__init__(properties)
            self.factors = properties["first"], properties["second"]

        def eval(self, si: Any, active: Any = True) -> Any:
            return self.factors[0].eval(si, active) * self.factors[1].eval(si, active)

        def is_spatially_varying(self) -> bool:
            return True

    mi.register_texture("ssgi_product", Product)
