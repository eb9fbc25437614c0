"""Virtual point lights, splatted: by their number, by the cut, interleaved, and with walls."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device_rsm import DeviceRsm
from ssgi_cl.rasterize.scene import Scene
from ssgi_cl.rasterize.shadow_map import rsm
from ssgi_cl.rasterize.view import device_scene
from ssgi_cl.techniques.vpl_splat import VplSplat, VplSplatParams
from ssgi_cl.truth import Truth

from ..case import Family, Own, Subject, count_of
from ..context import Context, exact

MAP_SIZE = 512
"""Texels along a side of the lamps' maps."""
PIXEL_BYTES = 4 * (1 + 3 + 3)
"""Depth and normal read, E written."""
MANY = ("256", "1024", "4096", "16384")
"""Numbers of lights that walls hide: with them thousands pay."""


@dataclass(frozen=True)
class VplsByNumber(Own):
    """All lights, without a cut; the setting is their number.

    Attributes:
        cull: tiles skip lights that lie behind them.
        interleave: each pixel of 4 x 4 takes one in 16.
        visibility: walls block light; then the G-buffer has four layers and a tenth of overscan.
        solid: all triangles are walls, not those alone that the camera and the lamps see.
    """

    cull: bool = True
    interleave: bool = False
    visibility: bool = False
    solid: bool = False
    SETTINGS: tuple[str, ...] = ("256", "1024", "4096")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make reflective shadow maps and splatting ready."""
        params = VplSplatParams(
            vpls=count_of(setting, "a number of lights", 1, 1 << 20), cutoff=0.0, cull=self.cull,
            interleave=self.interleave, visibility=self.visibility,
        )
        return vpl_subject(context, params, solid=self.solid)


@dataclass(frozen=True)
class VplsByCut(Own):
    """1024 lights without parts; the setting is the cut, of the irradiance at a tenth of the scene.

    That is, of the diagonal of its box: at 1 percent a light reaches across the whole scene. They
    are held to the same lights without a cut.

    Attributes:
        cull: tiles skip lights that give them nothing.
        restore: what the cut leaves out is put back.
    """

    cull: bool = True
    restore: bool = False
    SETTINGS: tuple[str, ...] = ("1-percent", "5-percent", "7-percent")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make reflective shadow maps and splatting ready."""
        percent = count_of(setting.removesuffix("-percent"), "N-percent, N a number", 1, 10_000)
        diagonal = float(np.linalg.norm(np.ptp(context.view.scene.bounds, axis=0)))
        params = VplSplatParams(
            cutoff=0.01 * percent, unit_distance=0.1 * diagonal, cull=self.cull,
            restore=self.restore, refine=0.0,
        )
        subject = vpl_subject(context, params)

        def uncut() -> Truth:
            image = vpl_subject(context, VplSplatParams(cutoff=0.0, refine=0.0)).image
            assert image is not None  # noqa: S101  it has one
            return exact(image())

        truths = {"assumption": lambda: context.truth("lights without a cut", lambda _: uncut())}
        return replace(subject, quantity="cut", truths=truths)


def vpl_subject(context: Context, params: VplSplatParams, *, solid: bool = False) -> Subject:
    """Return splatting with any parameters as a subject; `solid`: all triangles block light."""
    maps = drawn_maps(context)
    gbuffer = context.layered(4, 0.1) if params.visibility else context.gbuffer
    technique = VplSplat(context.runtime, context.size, params)
    scene = device_scene(context.view.scene, context.runtime) if solid else None
    pixels = context.size[0] * context.size[1]

    def image() -> NDArray[np.float32]:
        return np.moveaxis(technique.run(gbuffer, None, maps, scene=scene).download(), 0, -1)

    truths: dict[str, Callable[[], Truth]] = {"world": context.bounce}
    if not params.visibility:
        truths["assumption"] = lambda: context.bounce(visibility=False)
    return Subject(
        run=lambda: technique.run(gbuffer, None, maps, scene=scene),
        image=image,
        quantity="bounce",
        moved=pixels * PIXEL_BYTES,
        truths=truths,
        note="without drawing the maps and, as long as they stay, without choosing lights",
    )


def drawn_maps(
    context: Context, scene: Scene | None = None, size: int = MAP_SIZE
) -> list[DeviceRsm]:
    """Return the lamps' maps in device memory: of the view's scene, or of another in its place."""
    if not context.lamps:
        raise ValueError(f"{context.view.name} has no lamp: expected at least one")
    maps = []
    for lamp in context.lamps:
        drawn = rsm(scene or context.view.scene, lamp, size=size, runtime=context.runtime)
        device = DeviceRsm(
            context.runtime, drawn.cameras[0].size, len(drawn.cameras),
            glossy=drawn.specular_flux is not None,
        )
        device.upload(drawn)
        maps.append(device)
    return maps


FAMILIES: Mapping[str, Family] = {
    "vpl": VplsByNumber(),
    "vpl-plain": VplsByNumber(cull=False),
    "vpl-interleaved": VplsByNumber(interleave=True),
    "vpl-walls": VplsByNumber(interleave=True, visibility=True, solid=True, SETTINGS=MANY),
    "vpl-walls-seen": VplsByNumber(interleave=True, visibility=True, SETTINGS=MANY),
    "vpl-cut": VplsByCut(),
    "vpl-cut-plain": VplsByCut(cull=False),
    "vpl-cut-restored": VplsByCut(restore=True),
}
