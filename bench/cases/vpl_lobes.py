"""Virtual point lights with Phong lobes, splatted: light that glossy surfaces mirror."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context, exact

from ..drawn import DrawnMaps
from .vpl_splat import MANY, PIXEL_BYTES, lit

SPECULAR, GLOSS = 0.5, 60.0
"""Reflectance and exponent that all surfaces get."""
MAP_SIZE = 256
"""Texels along a side of the lights' maps; what lights are held to is each of them as a light."""
NO_LIGHTS = Vpls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


@dataclass(frozen=True)
class LobesByNumber(Own):
    """The scene as if all of it were glossy; the setting is the number of lights with lobes.

    Attributes:
        cull: tiles skip lights that give them nothing.
        cutoff: share of what a diffuse light gives at a tenth of the scene's diagonal, below which
            light is left out and put back with a sixteenth of the lights.
    """

    cull: bool = True
    cutoff: float = 0.0
    SETTINGS: tuple[str, ...] = MANY

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make reflective shadow maps of the glossy scene and splatting ready."""
        diagonal = float(np.linalg.norm(np.ptp(context.view.scene.bounds, axis=0)))
        params = VplSplatParams(
            vpls=1,
            glossy_vpls=count_of(setting, "a number of lights", 1, 1 << 20),
            cutoff=self.cutoff,
            unit_distance=0.1 * diagonal,
            cull=self.cull,
        )
        maps = DrawnMaps(context, MAP_SIZE, glossy=True, scene=polished(context.view.scene))
        technique = VplSplat(context.runtime, context.size, params)

        def every_texel() -> Truth:
            whole = replace(
                params, cutoff=0.0, cull=True, glossy_vpls=sum(rsm.size[0] * rsm.size[1] for rsm in maps.reflective())
            )
            return exact(_mirrored(VplSplat(context.runtime, context.size, whole), context, maps))

        return Subject(
            run=lambda: _mirrored(technique, context, maps),
            image=lambda: _mirrored(technique, context, maps),
            quantity="mirrored",
            moved=context.size[0] * context.size[1] * PIXEL_BYTES,
            truths={"assumption": lambda: context.truth("all texels as lobes", lambda _: every_texel())},
            counted=f"{DrawnMaps.counted}, lights chosen",
        )


def polished(scene: Scene) -> Scene:
    """Return a scene all of whose materials mirror half of the light in a lobe."""
    materials = [replace(material, specular=(SPECULAR,) * 3, gloss=GLOSS) for material in scene.materials]
    return replace(scene, materials=tuple(materials))


def _mirrored(technique: VplSplat, context: Context, maps: DrawnMaps) -> NDArray[np.float32]:
    """Return irradiance by lights with lobes alone."""
    return lit(context, maps, lambda rsms: technique.run(context.gbuffer, NO_LIGHTS, rsms=rsms))


FAMILIES: Mapping[str, Family] = {
    "vpl-lobes": LobesByNumber(),
    "vpl-lobes-plain": LobesByNumber(cull=False, SETTINGS=("1024",)),
    "vpl-lobes-cut": LobesByNumber(cutoff=0.05),
}
