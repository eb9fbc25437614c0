"""Virtual point lights, splatted: by their number, by the cutoff, interleaved, with walls, and with lobes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context, exact

from ..drawn import DrawnMaps, DrawnView, polished

MAP_SIZE = 512
"""Texels along a side of the lights' maps."""
GLOSSY_MAP_SIZE = 256
"""The same of lights with lobes; what these are held to is each texel as a light."""
PIXEL_BYTES = 4 * (1 + 3 + 3)
"""Depth and normal read, E written."""
WALLS = (4, 0.1)
"""Layers and overscan of the G-buffer where walls block light."""
FEW = ("256", "1024", "4096")
MANY = (*FEW, "16384")
"""Numbers of lights that walls hide: with them thousands pay."""
CUTS = ("1-percent", "5-percent", "7-percent")
NO_LIGHTS = Vpls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))


def by_number(
    context: Context,
    setting: str,
    *,
    cull: bool = True,
    interleave: bool = False,
    visibility: bool = False,
    solid: bool = False,
) -> Subject:
    """Make all lights ready, without a cut; the setting is their number.

    Args:
        context, setting: see `Family`.
        cull: tiles skip lights that lie behind them.
        interleave: each pixel of 4 x 4 takes one in 16.
        visibility: walls block light; then the G-buffer has four layers and a tenth of overscan.
        solid: all triangles block light, not only those that the camera and the lights see.
    """
    vpls = count_of(setting, "a number of lights", 1, 1 << 20)
    params = VplSplatParams(vpls=vpls, cutoff=0.0, cull=cull, interleave=interleave, visibility=visibility)
    return vpl_subject(context, params, solid=solid)


def by_cut(context: Context, setting: str, *, cull: bool = True, restore: bool = False) -> Subject:
    """Make 1024 lights ready; the setting is the cutoff of irradiance at a tenth of the scene.

    That is, of the diagonal of its box: at 1 percent a light reaches across the whole scene. They
    are held to the same lights without a cutoff.

    Args:
        context, setting: see `Family`.
        cull: tiles skip lights that give them nothing.
        restore: what the cutoff leaves out is put back.
    """
    percent = count_of(setting.removesuffix("-percent"), "N-percent, N a number", 1, 10_000)
    params = VplSplatParams(
        cutoff=0.01 * percent, unit_distance=_tenth(context), cull=cull, restore=restore, refine=0.0
    )

    def uncut() -> Truth:
        image = vpl_subject(context, VplSplatParams(cutoff=0.0, refine=0.0)).image
        assert image is not None  # noqa: S101  it has one
        return exact(image())

    truths = {"assumption": lambda: context.shared("lights without a cut", uncut)}
    return replace(vpl_subject(context, params), quantity="cut", truths=truths)


def _tenth(context: Context) -> float:
    """Return a tenth of the diagonal of the scene's box."""
    return 0.1 * float(np.linalg.norm(np.ptp(context.view.scene.bounds, axis=0)))


def vpl_subject(context: Context, params: VplSplatParams, *, solid: bool = False) -> Subject:
    """Return splatting with any parameters as a subject; `solid`: all triangles block light."""
    maps = DrawnMaps(context, MAP_SIZE)
    walls = params.visibility and not solid
    view = DrawnView(context, *(WALLS if walls else (1, 0.0)))
    technique = VplSplat(context.runtime, context.size, params)
    scene = device_scene(context.view.scene, context.runtime) if solid else None
    truths: dict[str, Callable[[], Truth]] = {"world": context.bounce}
    if not params.visibility:
        truths["assumption"] = context.unblocked_bounce
    return Subject.of_image(
        lambda: lit(context, maps, lambda rsms: technique.run(view.draw(), rsms=rsms, scene=scene)),
        quantity="bounce",
        moved=context.pixels * PIXEL_BYTES,
        truths=truths,
        counted=counted(view),
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


def with_lobes(context: Context, setting: str, *, cull: bool = True, cutoff: float = 0.0) -> Subject:
    """Make the scene ready as if all of it were glossy; the setting is the number of lights with lobes.

    Args:
        context, setting: see `Family`.
        cull: tiles skip lights that give them nothing.
        cutoff: share of what a diffuse light gives at a tenth of the scene's diagonal, below which
            light is left out and put back with a sixteenth of the lights.
    """
    lights = count_of(setting, "a number of lights", 1, 1 << 20)
    params = VplSplatParams(vpls=1, glossy_vpls=lights, cutoff=cutoff, unit_distance=_tenth(context), cull=cull)
    maps = DrawnMaps(context, GLOSSY_MAP_SIZE, glossy=True, scene=polished(context.view.scene))
    technique = VplSplat(context.runtime, context.size, params)

    def mirrored(technique: VplSplat) -> NDArray[np.float32]:
        """Return irradiance by lights with lobes alone."""
        return lit(context, maps, lambda rsms: technique.run(context.gbuffer, NO_LIGHTS, rsms=rsms))

    def every_texel() -> Truth:
        texels = sum(rsm.size[0] * rsm.size[1] for rsm in maps.reflective())
        whole = replace(params, cutoff=0.0, cull=True, glossy_vpls=texels)
        return exact(mirrored(VplSplat(context.runtime, context.size, whole)))

    return Subject.of_image(
        lambda: mirrored(technique),
        quantity="mirrored",
        moved=context.pixels * PIXEL_BYTES,
        truths={"assumption": lambda: context.shared("all texels as lobes", every_texel)},
        counted=f"{DrawnMaps.counted}, lights chosen",
    )


FAMILIES: Mapping[str, Family] = {
    "vpl": Family(by_number, FEW),
    "vpl-plain": Family(partial(by_number, cull=False), FEW),
    "vpl-interleaved": Family(partial(by_number, interleave=True), FEW),
    "vpl-visibility": Family(partial(by_number, interleave=True, visibility=True, solid=True), MANY),
    "vpl-visibility-seen": Family(partial(by_number, interleave=True, visibility=True), MANY),
    "vpl-cut": Family(by_cut, CUTS),
    "vpl-cut-plain": Family(partial(by_cut, cull=False), CUTS),
    "vpl-cut-restored": Family(partial(by_cut, restore=True), CUTS),
    "vpl-lobes": Family(with_lobes, MANY),
    "vpl-lobes-plain": Family(partial(with_lobes, cull=False), ("1024",)),
    "vpl-lobes-cut": Family(partial(with_lobes, cutoff=0.05), MANY),
}
