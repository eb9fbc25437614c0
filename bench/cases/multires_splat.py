"""Virtual point lights at few pixels: by the error that is allowed, and as published."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.multires.multires_published import MultiresPublished, MultiresPublishedParams
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps, DrawnView
from .vpl_splat import MANY, MAP_SIZE, PIXEL_BYTES, WALLS, counted, lit

GEOMETRY = "geometry"


def by_error(
    context: Context, setting: str, *, lights: int = 1024, light_share: float = 0.7, coarsest: int = 16
) -> Subject:
    """Make lights and multiresolution splatting ready.

    The setting is the error of interpolation, of the mean irradiance; or geometry decides alone.

    Args:
        context, setting: see `Family`.
        lights: how many.
        light_share: of it that each few lights which stand for many may be off.
        coarsest: see `MultiresGridParams`; 1 computes every pixel.
    """
    wanted = "N-permille, N a number, or geometry"
    few = 0.01 if setting == GEOMETRY else 1e-3 * count_of(setting.removesuffix("-permille"), wanted, 1, 10_000)
    params = MultiresSplatParams(
        vpls=lights,
        interpolation_error=1e6 if setting == GEOMETRY else few,
        light_error=light_share * few,
        coarsest=coarsest,
    )
    technique = MultiresSplat(context.runtime, context.size, params)
    return _few_pixels(
        context,
        technique,
        params.refine,
        lambda: f"{_share(context, technique.grid.counts().values())} of the pixels computed",
    )


def published(context: Context, setting: str) -> Subject:
    """Make subsplats by geometry alone ready, without visibility; the setting is the number of lights."""
    params = MultiresPublishedParams(vpls=count_of(setting, "a number of lights", 1, 1 << 20))
    technique = MultiresPublished(context.runtime, context.size, params)
    return _few_pixels(
        context, technique, 0.0, lambda: f"subsplats for {_share(context, technique.counts())} of the pixels"
    )


def with_walls(context: Context, setting: str, *, error: float = 0.05, solid: bool = True) -> Subject:
    """Make the same ready where surfaces block reflected light; the setting is the number of lights.

    Args:
        context, setting: see `Family`.
        error: of interpolation, and of few lights for many; less shows the grid's cells alone.
        solid: all triangles block light, not only those that the camera and the lights see.
    """
    params = MultiresSplatParams(
        vpls=count_of(setting, "a number of lights", 1, 1 << 20),
        interpolation_error=error,
        light_error=error,
        visibility=True,
    )
    maps, view = DrawnMaps(context, MAP_SIZE), DrawnView(context, *((1, 0.0) if solid else WALLS))
    technique = MultiresSplat(context.runtime, context.size, params)
    scene = device_scene(context.view.scene, context.runtime) if solid else None

    def image() -> NDArray[np.float32]:
        return lit(context, maps, lambda rsms: technique.run(view.draw(), rsms=rsms, scene=scene))

    image()
    return Subject.of_image(
        image,
        quantity="bounce",
        moved=context.pixels * PIXEL_BYTES,
        truths={"world": context.bounce},
        counted=counted(view),
        note=f"{_share(context, technique.grid.counts().values())} of the pixels computed",
    )


def _few_pixels(
    context: Context, technique: MultiresSplat | MultiresPublished, refine: float, computed: Callable[[], str]
) -> Subject:
    """Return a technique without visibility that computes few pixels as a subject.

    Args:
        context: the scene and its view.
        technique: prepared.
        refine: of `VplSplatParams`, for the light of all lights at all pixels.
        computed: says at how many pixels the light was computed, once it was.
    """
    maps, view, lights = DrawnMaps(context, MAP_SIZE), DrawnView(context, 1, 0.0), technique.params.vpls

    def image() -> NDArray[np.float32]:
        return lit(context, maps, lambda rsms: technique.run(view.draw(), rsms=rsms))

    found = image()
    off = relative_rmse(found - all_lights(context, maps, lights, refine), found)
    return Subject.of_image(
        image,
        quantity="bounce",
        moved=context.pixels * PIXEL_BYTES,
        truths={"world": context.bounce, "assumption": context.unblocked_bounce},
        counted=counted(view),
        note=f"{lights} lights; {computed()}; off all lights at all pixels by {off:.2f} % of the mean (RMSE)",
    )


def _share(context: Context, counts: Iterable[int]) -> str:
    """Return a sum of counts of pixels in per cent of the image."""
    return f"{100 * sum(counts) / context.pixels:.1f} %"


def all_lights(context: Context, maps: DrawnMaps, count: int, refine: float) -> NDArray[np.float32]:
    """Return the irradiance of all lights, each pixel computed."""
    technique = VplSplat(context.runtime, context.size, VplSplatParams(vpls=count, cutoff=0.0, refine=refine))
    return lit(context, maps, lambda rsms: technique.run(context.gbuffer, rsms=rsms))


def relative_rmse(off: NDArray[np.float32], image: NDArray[np.float32]) -> float:
    """Return a root of mean squares in percent of the mean of an image, where anything is lit."""
    lit = np.any(image > 0.0, axis=-1)
    rmse = math.sqrt(np.mean(off[lit] ** 2)) if lit.any() else 0.0
    return 100.0 * rmse / max(float(image.sum()) / max(3 * int(lit.sum()), 1), 1e-30)


FAMILIES: Mapping[str, Family] = {
    "multires": Family(by_error, ("5-permille", "10-permille", "20-permille", "40-permille")),
    "multires-visibility": Family(with_walls, MANY),
    "multires-visibility-seen": Family(partial(with_walls, solid=False), MANY),
    # As KlayGE's port has it, with which it is compared at 1280 x 800; and with a bound.
    "multires-geometry": Family(partial(by_error, lights=256), (GEOMETRY, "10-permille")),
    "multires-every-pixel": Family(partial(by_error, coarsest=1), ("10-permille",)),
    "multires-published": Family(published, ("256", "1024")),
}
