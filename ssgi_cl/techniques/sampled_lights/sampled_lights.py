"""Environments with visibility at any distance: directions by importance, a depth map each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Light
from ssgi_cl.core.params import Params, Prepared, param, with_fields_described
from ssgi_cl.core.sample_views import PATTERN, interleaved
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA
from ssgi_cl.device.transient import Target
from ssgi_cl.techniques.bands import banded, fixed_plan
from ssgi_cl.techniques.environment_light import lit_by_environments
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.sampled_lights.sampled_maps import SampledMaps
from ssgi_cl.techniques.technique import Technique

FIELDS = 20
OFFSET = 1.0
"""Diagonals of a texel by which a receiver is moved along its normal: the farthest of 2 x 2 texels
is so far off, and depth there differs by that times the tangent of the light's angle at most."""
MOST_BLUR = 16
"""Radius of the blur at most, px."""


@dataclass(frozen=True, kw_only=True)
class SampledLightsParams(Params):
    """Parameters of sampled lights."""

    directions: int = param(
        128, "directions that stand for all environments; rounded up to a multiple of 16", low=16, high=1024
    )
    map_size: int = param(256, "side of each direction's depth map", low=16, high=2048, unit="texels")
    blur: int = param(
        7,
        "radius of the edge-aware blur that averages the 4 x 4 sets of directions; 0 for none",
        low=0,
        high=MOST_BLUR,
        unit="px",
    )

    @property
    def count(self) -> int:
        """Directions, a multiple of 16."""
        return -(-self.directions // PATTERN) * PATTERN


def _blur_params(radius: int) -> BilateralParams:
    """Return a blur in which patterns of 4 pixels vanish: of 7 pixels, all but 0.07 % of them."""
    return BilateralParams(radius=radius, sigma=0.25 * radius + 0.55)


class SampledLightsKeywords(TypedDict, total=False):
    """The parameters of `sampled_lights`."""

    directions: int
    map_size: int
    blur: int


class SampledLights(Prepared[SampledLightsParams]):
    """Sampled lights, prepared for images of one size.

    Debevec 2005. Departs: see `sampled_lights`. Directions and maps are kept, see `SampledMaps`.

    Args:
        runtime: the device.
        size: (rows, columns) of the images.
        params: of the technique.
        kept: whether results are in memory of its own; else each lives as long as somebody refers
            to it.
    """

    def __init__(
        self, runtime: Runtime, size: Size, params: SampledLightsParams | None = None, *, kept: bool = True
    ) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or SampledLightsParams()
        self._irradiance = Target(runtime, 3, size, kept=kept)
        self._blur = Bilateral(runtime, size, _blur_params(params.blur), 3, kept=kept)
        self._light = runtime.kernel(
            "sampled_lights/sampled_lights.cl", {"SAMPLED_COUNT": params.count // PATTERN}, (CAMERA,)
        )
        self._order = interleaved(params.count)
        self._samples = runtime.empty(params.count * 4 * FIELDS, np.float32)
        self._maps: SampledMaps | None = None

    def run(
        self, gbuffer: DeviceGBuffer, lights: Sequence[Light], *, scene: Scene, maps: SampledMaps | None = None
    ) -> Plane | None:
        """Queue the passes; return irradiance by all environments, None if there is no light.

        3 images, W/m^2; 0 where nothing is. Other lights are passed over. `maps` have been drawn of the
        same scene and lights, by others: without, this draws its own.
        """
        if maps is None:
            self._maps = self._maps or SampledMaps(self.runtime, self.params.count, self.params.map_size)
            maps = self._maps.draw(scene, lights)
        if not len(maps.directions):
            self.runtime.skip("sampled lights", "no environment sends light")
            return None
        self._samples.send(self._table(maps, gbuffer, scene))
        with self._irradiance.over(gbuffer.seen) as (irradiance, region):
            self._light.run(
                self.size,
                region=region,
                depth=gbuffer.depth,
                normal=gbuffer.normal,
                samples=self._samples,
                maps=maps.ready(),
                irradiance=irradiance,
                camera=gbuffer.camera_struct,
                margin_columns=gbuffer.margin[1],
                margin_rows=gbuffer.margin[0],
                texels=maps.texels,
            )
        return self._blur.run(gbuffer, irradiance, region=region)

    def _table(self, maps: SampledMaps, gbuffer: DeviceGBuffer, scene: Scene) -> NDArray[np.float32]:
        """Return [count / 16, 4, FIELDS, 16], see kernels/sampled_lights/sampled_lights.cl."""
        camera = gbuffer.camera
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        turn = camera.view[:3, :3]
        # In float64: the eye relative to the scene's origin may be a small difference.
        eye = camera.position - scene.origin
        rows = maps.views[:, :, :3]
        fields = np.column_stack(
            [
                maps.directions @ turn.T,
                maps.flux * PATTERN,
                np.concatenate([rows @ turn.T, (rows @ eye + maps.views[:, :, 3])[..., None]], axis=-1).reshape(-1, 12),
                OFFSET * maps.diagonals,
                np.arange(len(maps.views)),
            ]
        )
        table = np.moveaxis(fields[self._order], -1, 2)  # [groups, 4, fields, 4]
        return np.ascontiguousarray(np.tile(table, 4), np.float32)


@banded(fixed_plan(MOST_BLUR))
@with_fields_described(SampledLightsParams)
@serialised
def sampled_lights(
    gbuffer: GBuffer | DeviceGBuffer,
    lights: Sequence[Light],
    *,
    scene: Scene,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[SampledLightsKeywords],
) -> NDArray[np.float32]:
    """Compute irradiance by environments, shadowed by all of a scene at any distance.

    Directions of equal flux stand for the environments, each with a depth map over the whole
    scene; pixels test an interleaved subset and an edge-aware blur averages the subsets. Occluders
    narrower than a map's texel, and contacts nearer than one, are missed.

    Debevec 2005, "A Median Cut Algorithm for Light Probe Sampling", with the pixels of Keller and
    Heidrich 2001, "Interleaved Sampling". Departs: regions are of an equal-area map; a region is
    cut across its longer side.

    Args:
        gbuffer: the receivers.
        lights: environments among them are sampled; others are passed over.
        scene: what casts shadows. Its maps are kept for the next call with the same objects.
        max_memory: as of `gtao`.
        runtime: the device; by default the fastest found.
        **params: the fields of `SampledLightsParams`.

    Returns:
        Irradiance in W/m^2, [rows, columns, 3] float32; 0 where nothing is.

    Raises:
        TypeError, ValueError: an argument of the wrong type, or a parameter out of range.
    """
    return lit_by_environments(SampledLights, SampledLightsParams(**params), gbuffer, lights, scene, runtime)


DESCRIPTOR = Technique(
    name="sampled_lights",
    kind="shading",
    paper="Debevec 2005",
    function=sampled_lights,
    params=SampledLightsParams,
    technique=SampledLights,
    reference="ssgi_cl.reference.sampled_lights.sampled_lights",
    reads=("depth", "normal", "lights", "scene"),
    writes=("irradiance",),
)
