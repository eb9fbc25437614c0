"""The whole picture: all bounces of the light of all sources, and the sky's visibility."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ssgi_cl.core import checks
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.constants import VPL_MARGIN_CELLS
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.lobes import Lobes
from ssgi_cl.frame.stage import Stage
from ssgi_cl.frame.stages import final_gather_stage, radiosity_stage, sky_light_stage
from ssgi_cl.techniques.indirect.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.indirect.occupancy_grid import MOST_CELLS
from ssgi_cl.techniques.indirect.radiosity import Radiosity, RadiosityParams
from ssgi_cl.techniques.sampled_lights import SampledLights, SampledLightsParams

MOST_BOUNCES = 1000

CONTACT = 2.0
"""Cells of the occupancy grid within which visibility rays miss what blocks them: ambient occlusion
of that radius stands in for them, of the sky's light, and in gaps of the bounces too."""

SURFEL_CAPACITY = 2
"""Light sources that radiosity returns, at most, over the surfels asked for."""


@dataclass(frozen=True, kw_only=True)
class WholeParams:
    """How exactly all light is computed.

    Attributes:
        bounces: reflections on the way from a light to a pixel: 1 or more, or "all".
        vpls: virtual point lights for the first bounce of punctual lights.
        surfels: pieces of surfaces that carry all other light.
        directions: that stand for environments.
        map_size: texels along the side of the depth map of each.
        error: of the final gather's interpolation and light tree, of the mean irradiance by all
            light, direct and sky light included.
    """

    bounces: int | str = "all"
    vpls: int = 4096
    surfels: int = 2048
    directions: int = 128
    map_size: int = 128
    error: float = 0.15

    def stages(self, runtime: Runtime, size: Size) -> tuple[list[Stage], Lobes]:
        """Return the stages of a frame that compute it, prepared for pictures of one size, and
        what adds the reflections of glossy surfaces to their sum."""
        radiosity = Radiosity(runtime, RadiosityParams(surfels=self.surfels, bounces=self.bounces))
        splat = MultiresSplat(
            runtime,
            size,
            MultiresSplatParams(
                vpls=self.vpls, visibility=True, grid=MOST_CELLS, interpolation_error=self.error, light_error=self.error
            ),
            surfels=SURFEL_CAPACITY * self.surfels,
        )
        sky = SampledLights(runtime, size, SampledLightsParams(directions=self.directions, map_size=self.map_size))
        stages = [radiosity_stage(radiosity), sky_light_stage(sky), final_gather_stage(splat, runtime)]
        return stages, Lobes(runtime, size, splat, radiosity)


PRESETS = {
    "low": WholeParams(vpls=1024, surfels=512, directions=64, error=0.2),
    "medium": WholeParams(vpls=2048, surfels=1024),
    "high": WholeParams(),
    "ultra": WholeParams(vpls=16384, surfels=8192, directions=256, map_size=256, error=0.02),
}
"""By name, from the fastest to the most exact; "high" is the default."""

DEFAULT_PRESET = "high"


def whole_params(bounces: object, preset: object, indirect: object) -> WholeParams | None:
    """Return what `render` is asked for by these arguments; None without the whole picture.

    Raises:
        TypeError, ValueError: a wrong one, or two that exclude each other.
    """
    if isinstance(bounces, str):
        checks.choice("bounces", bounces, ("all",))
    elif bounces is not None:
        bounces = checks.integer("bounces", bounces, low=0, high=MOST_BOUNCES, unit="reflections")
    name = DEFAULT_PRESET if preset is None else checks.choice("preset", preset, tuple(PRESETS))
    technique = indirect is not None and indirect is not False
    if technique and bounces:
        raise ValueError(
            f"bounces is {bounces!r}: expected None or 0 with indirect={indirect!r}, which "
            "reflects light once by itself"
        )
    if bounces is None:
        bounces = 0 if technique or indirect is False else "all"
    if bounces == 0:
        if preset is not None:
            raise ValueError(
                f"preset is {preset!r}: expected None without bounces; it applies to the whole picture only"
            )
        return None
    assert isinstance(bounces, (int, str))  # noqa: S101  checked above
    return replace(PRESETS[name], bounces=bounces)


def cell_size(scene: Scene) -> float:
    """Return the side of a cell of the occupancy grid that holds a scene, scene units."""
    return float(np.ptp(scene.bounds, axis=0).max() or 1.0) / (MOST_CELLS - VPL_MARGIN_CELLS)
