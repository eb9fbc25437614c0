"""The whole picture: all bounces of the light of all sources, and the sky's visibility."""

from __future__ import annotations

from dataclasses import dataclass

from ssgi_cl.core import checks
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.stage import Stage
from ssgi_cl.frame.stages import final_gather_stage, radiosity_stage, sky_light_stage
from ssgi_cl.techniques.indirect.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.indirect.occupancy_grid import MOST_CELLS
from ssgi_cl.techniques.indirect.radiosity import Radiosity, RadiosityParams
from ssgi_cl.techniques.shading.sky_light import SkyLight, SkyLightParams

SURFEL_ROOM = 2
"""Light sources that radiosity returns, at most, over the surfels asked for."""


@dataclass(frozen=True, kw_only=True)
class WholeParams:
    """How exactly all light is computed.

    Attributes:
        bounces: reflections on the way from a light to a pixel: 1 or more, or "all".
        vpls: virtual point lights for the first bounce of punctual lights.
        surfels: pieces of surfaces that carry all other light.
        directions: that stand for environments.
        error: of the final gather's interpolation and light tree, of the mean irradiance.
    """

    bounces: int | str = "all"
    vpls: int = 4096
    surfels: int = 4096
    directions: int = 128
    error: float = 0.05

    def stages(self, runtime: Runtime, size: Size) -> list[Stage]:
        """Return the stages of a frame that compute it, prepared for pictures of one size."""
        radiosity = Radiosity(
            runtime, RadiosityParams(surfels=self.surfels, bounces=self.bounces)
        )
        splat = MultiresSplat(runtime, size, MultiresSplatParams(
            vpls=self.vpls, surfels=SURFEL_ROOM * self.surfels, visibility=True, grid=MOST_CELLS,
            error=self.error, light_error=self.error,
        ))
        sky = SkyLight(runtime, size, SkyLightParams(directions=self.directions))
        return [
            radiosity_stage(radiosity), sky_light_stage(sky), final_gather_stage(splat, runtime)
        ]


PRESETS = {
    "low": WholeParams(vpls=1024, surfels=1024, directions=64, error=0.1),
    "medium": WholeParams(vpls=2048, surfels=2048, directions=128),
    "high": WholeParams(vpls=4096, surfels=4096, directions=128),
    "ultra": WholeParams(vpls=16384, surfels=8192, directions=256, error=0.02),
}
"""By name, from the fastest to the most exact; "high" is the default."""

DEFAULT_PRESET = "high"


def checked_bounces(bounces: object) -> int | str:
    """Return `bounces` of `render`.

    Raises:
        TypeError, ValueError: neither an integer from 0 on nor "all".
    """
    if isinstance(bounces, str):
        return checks.choice("bounces", bounces, ("all",))
    return checks.integer("bounces", bounces, low=0, high=1000, unit="reflections")
