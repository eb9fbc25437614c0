"""Virtual point lights, splatted: by their number, by the cutoff, interleaved, and with walls."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context, exact

from ..drawn import DrawnMaps, DrawnView

MAP_SIZE = 512
"""Texels along a side of the lights' maps."""
PIXEL_BYTES = 4 * (1 + 3 + 3)
"""Depth and normal read, E written."""
WALLS = (4, 0.1)
"""Layers and overscan of the G-buffer where walls block light."""
MANY = ("256", "1024", "4096", "16384")
"""Numbers of lights that walls hide: with them thousands pay."""


@dataclass(frozen=True)
class VplsByNumber(Own):
    """All lights, without a cut; the setting is their number.

    Attributes:
        cull: tiles skip lights that lie behind them.
        interleave: each pixel of 4 x 4 takes one in 16.
        visibility: walls block light; then the G-buffer has four layers and a tenth of overscan.
        solid: all triangles block light, not only those that the camera and the lights see.
    """

    cull: bool = True
    interleave: bool = False
    visibility: bool = False
    solid: bool = False
    SETTINGS: tuple[str, ...] = ("256", "1024", "4096")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make reflective shadow maps and splatting ready."""
        params = VplSplatParams(
            vpls=count_of(setting, "a number of lights", 1, 1 << 20),
            cutoff=0.0,
            cull=self.cull,
            interleave=self.interleave,
            visibility=self.visibility,
        )
        return vpl_subject(context, params, solid=self.solid)


@dataclass(frozen=True)
class VplsByCut(Own):
    """1024 lights without parts; the setting: the cutoff of irradiance at a tenth of the scene.

    That is, of the diagonal of its box: at 1 percent a light reaches across the whole scene. They
    are held to the same lights without a cutoff.

    Attributes:
        cull: tiles skip lights that give them nothing.
        restore: what the cutoff leaves out is put back.
    """

    cull: bool = True
    restore: bool = False
    SETTINGS: tuple[str, ...] = ("1-percent", "5-percent", "7-percent")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make reflective shadow maps and splatting ready."""
        percent = count_of(setting.removesuffix("-percent"), "N-percent, N a number", 1, 10_000)
        diagonal = float(np.linalg.norm(np.ptp(context.view.scene.bounds, axis=0)))
        params = VplSplatParams(
            cutoff=0.01 * percent, unit_distance=0.1 * diagonal, cull=self.cull, restore=self.restore, refine=0.0
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
    maps = DrawnMaps(context, MAP_SIZE)
    walls = params.visibility and not solid
    view = DrawnView(context, *(WALLS if walls else (1, 0.0)))
    technique = VplSplat(context.runtime, context.size, params)
    scene = device_scene(context.view.scene, context.runtime) if solid else None
    pixels = context.size[0] * context.size[1]

    def image() -> NDArray[np.float32]:
        return lit(context, maps, lambda rsms: technique.run(view.draw(), rsms=rsms, scene=scene))

    truths: dict[str, Callable[[], Truth]] = {"world": context.bounce}
    if not params.visibility:
        truths["assumption"] = context.unblocked_bounce
    return Subject(
        run=image, image=image, quantity="bounce", moved=pixels * PIXEL_BYTES, truths=truths, counted=counted(view)
    )


def lit(context: Context, maps: DrawnMaps, shine: Callable[[Sequence[DeviceRsm]], Plane]) -> NDArray[np.float32]:
    """Draw a view's maps; return the irradiance [rows, columns, 3] that `shine` makes of them."""
    with context.runtime.frame():
        rsms = maps.reflective()
        if not rsms:
            return np.zeros((*context.size, 3), np.float32)
        planes = shine(rsms).download()
    return np.ascontiguousarray(np.moveaxis(planes, 0, -1))


def counted(view: DrawnView) -> str:
    """Return what a run of lights from maps counts beside the technique."""
    return "; ".join(filter(None, (view.counted, f"{DrawnMaps.counted}, lights chosen")))


FAMILIES: Mapping[str, Family] = {
    "vpl": VplsByNumber(),
    "vpl-plain": VplsByNumber(cull=False),
    "vpl-interleaved": VplsByNumber(interleave=True),
    "vpl-visibility": VplsByNumber(interleave=True, visibility=True, solid=True, SETTINGS=MANY),
    "vpl-visibility-seen": VplsByNumber(interleave=True, visibility=True, SETTINGS=MANY),
    "vpl-cut": VplsByCut(),
    "vpl-cut-plain": VplsByCut(cull=False),
    "vpl-cut-restored": VplsByCut(restore=True),
}
