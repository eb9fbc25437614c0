"""Virtual point lights at few pixels: by the error that is allowed, against all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.multires.multires_published import MultiresPublished
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.vpl.vpl_splat import VplSplat, VplSplatParams
from ssgi_cl.truth import Truth
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps, DrawnView
from .vpl_splat import MANY, MAP_SIZE, PIXEL_BYTES, WALLS, counted, lit

GEOMETRY = "geometry"


@dataclass(frozen=True)
class MultiresByError(Own):
    """The setting is the error of interpolation, of the mean irradiance; or geometry decides alone.

    Attributes:
        lights: how many.
        light_share: of it that each few lights which stand for many may be off.
        coarsest: see `MultiresGridParams`; 1 computes every pixel.
    """

    lights: int = 1024
    light_share: float = 0.7
    coarsest: int = 16
    SETTINGS: tuple[str, ...] = ("5-permille", "10-permille", "20-permille", "40-permille")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make lights and multiresolution splatting ready."""
        wanted = "N-permille, N a number, or geometry"
        few = 0.01 if setting == GEOMETRY else 1e-3 * count_of(setting.removesuffix("-permille"), wanted, 1, 10_000)
        params = MultiresSplatParams(
            vpls=self.lights,
            interpolation_error=1e6 if setting == GEOMETRY else few,
            light_error=self.light_share * few,
            coarsest=self.coarsest,
        )
        technique = MultiresSplat(context.runtime, context.size, params)
        return few_pixels_subject(
            context,
            technique,
            params.vpls,
            params.refine,
            lambda: f"{share_of(context, technique.grid.counts().values())} of the pixels computed",
        )


@dataclass(frozen=True)
class MultiresVisibility(Own):
    """Surfaces block reflected light; the setting is the number of lights.

    Attributes:
        error: of interpolation, and of few lights for many; less shows the grid's cells alone.
        solid: all triangles block light, not only those that the camera and the lights see.
    """

    error: float = 0.05
    solid: bool = True
    SETTINGS: tuple[str, ...] = MANY

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make reflective shadow maps and multiresolution splatting ready."""
        params = MultiresSplatParams(
            vpls=count_of(setting, "a number of lights", 1, 1 << 20),
            interpolation_error=self.error,
            light_error=self.error,
            visibility=True,
        )
        maps = DrawnMaps(context, MAP_SIZE)
        view = DrawnView(context, *((1, 0.0) if self.solid else WALLS))
        technique = MultiresSplat(context.runtime, context.size, params)
        scene = device_scene(context.view.scene, context.runtime) if self.solid else None
        pixels = context.size[0] * context.size[1]

        def image() -> NDArray[np.float32]:
            return lit(context, maps, lambda rsms: technique.run(view.draw(), rsms=rsms, scene=scene))

        image()
        return Subject(
            run=image,
            image=image,
            quantity="bounce",
            moved=pixels * PIXEL_BYTES,
            truths={"world": context.bounce},
            counted=counted(view),
            note=f"{share_of(context, technique.grid.counts().values())} of the pixels computed",
        )


def few_pixels_subject(
    context: Context,
    technique: MultiresSplat | MultiresPublished,
    lights: int,
    refine: float,
    computed: Callable[[], str],
) -> Subject:
    """Return a technique without visibility that computes few pixels as a subject.

    Args:
        context: the scene and its view.
        technique: prepared.
        lights: how many.
        refine: of `VplSplatParams`, for the light of all lights at all pixels.
        computed: says at how many pixels the light was computed, once it was.
    """
    maps, view = DrawnMaps(context, MAP_SIZE), DrawnView(context, 1, 0.0)

    def image() -> NDArray[np.float32]:
        return lit(context, maps, lambda rsms: technique.run(view.draw(), rsms=rsms))

    found = image()
    off = relative_rmse(found - all_lights(context, maps, lights, refine), found)
    truths: dict[str, Callable[[], Truth]] = {"world": context.bounce, "assumption": context.unblocked_bounce}
    return Subject(
        run=image,
        image=image,
        quantity="bounce",
        moved=context.size[0] * context.size[1] * PIXEL_BYTES,
        truths=truths,
        counted=counted(view),
        note=f"{lights} lights; {computed()}; off all lights at all pixels by {off:.2f} % of the mean (RMSE)",
    )


def share_of(context: Context, counts: Iterable[int]) -> str:
    """Return a sum of counts of pixels in per cent of the image."""
    return f"{100 * sum(counts) / (context.size[0] * context.size[1]):.1f} %"


def all_lights(context: Context, maps: DrawnMaps, count: int, refine: float) -> NDArray[np.float32]:
    """Return the irradiance of all lights, each pixel computed."""
    params = VplSplatParams(vpls=count, cutoff=0.0, refine=refine)
    technique = VplSplat(context.runtime, context.size, params)
    return lit(context, maps, lambda rsms: technique.run(context.gbuffer, rsms=rsms))


def relative_rmse(off: NDArray[np.float32], image: NDArray[np.float32]) -> float:
    """Return a root of mean squares in percent of the mean of an image, where anything is lit."""
    lit = np.any(image > 0.0, axis=-1)
    rmse = math.sqrt(np.mean(off[lit] ** 2)) if lit.any() else 0.0
    return 100.0 * rmse / max(float(image.sum()) / max(3 * int(lit.sum()), 1), 1e-30)


FAMILIES: Mapping[str, Family] = {
    "multires": MultiresByError(),
    "multires-visibility": MultiresVisibility(),
    "multires-visibility-seen": MultiresVisibility(solid=False),
    # As KlayGE's port has it, with which it is compared at 1280 x 800; and with a bound.
    "multires-geometry": MultiresByError(lights=256, SETTINGS=(GEOMETRY, "10-permille")),
    "multires-every-pixel": MultiresByError(coarsest=1, SETTINGS=("10-permille",)),
}
