"""Parameters of directional occlusion, and those of its parts that follow from them."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TypeVar, get_args

from ssgi_cl.core.names import SsdoMethod
from ssgi_cl.core.params import Params, param, parameter_fields
from ssgi_cl.device.arrays import Size
from ssgi_cl.techniques.ao.bitmask import MOST_TAPS
from ssgi_cl.techniques.ao.occlusion import OcclusionKeywords, OcclusionParams
from ssgi_cl.techniques.direct.light_shadows import LightShadowParams
from ssgi_cl.techniques.filters.bilateral import BilateralParams
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmaskParams
from ssgi_cl.techniques.ssdo.ssdo_points import PointsParams
from ssgi_cl.techniques.ssdo.ssdo_views import ViewsParams

P = TypeVar("P", bound=Params)

METHODS = get_args(SsdoMethod)
METHODS_OF = {"strength": ("published",), "nearest_distance": ("published",), "thickness": ("bitmask", "points")}
"""Methods of the parameters that don't apply to every method."""


@dataclass(frozen=True, kw_only=True)
class SsdoParams(OcclusionParams):
    """Parameters of directional occlusion and one bounce (Ritschel, Grosch and Seidel 2009).

    Light is sought farther away than occlusion is, so taps are more than those of `bitmask_ao`. In
    the Cornell box with the size of the room as radius, a single view misses the light of the tall
    block's top and has an RMSE of .73 of the mean; four depth layers with all attributes have .37
    with 20 taps, and .17 with 64.
    """

    radius: float = param(
        0.5, "distance up to which surfaces occlude and send light", low=0.0, high=1e30, above=True, unit="scene units"
    )
    method: SsdoMethod = param(
        "bitmask",
        "how surfaces are found: slices along the view direction, in which they cover "
        "sectors; directions of the hemisphere, which meet them; or one tap for each direction, as "
        "published, whose light is not conserved",
        choices=METHODS,
    )
    bounce: bool = param(True, "whether surfaces within the radius reflect light")
    emission: bool = param(True, "whether surfaces send emitted light too; small bright ones make noise")
    slices: int = param(2, "bitmask: planes along the view direction", low=1, high=32)
    taps: int = param(20, "bitmask: depths read on either side of a slice", low=1, high=64)
    blur_radius: int = param(
        4, "edge-aware blur against the noise of the 4 x 4 tile; 0 for none", low=0, high=16, unit="px"
    )
    samples: int = param(
        16,
        "points, published: directions per pixel; with one tap each as published, else with "
        "the root of as many, and two",
        low=1,
        high=256,
    )
    thickness: float = param(
        0.0, "bitmask, points: of surfaces, along the view ray", low=0.0, high=1e3, unit="radii", shape=bool
    )
    view_taps: int = param(
        4,
        "bitmask: depths of an auxiliary camera read in each unoccluded direction, of which a "
        "slice has the square root of this number, at least 2; take more where the radius is as "
        "large as the scene",
        low=1,
        high=64,
    )
    shadow_taps: int = param(
        12, "depths read on the way to a light that has no shadow map; 0: it casts no shadow", low=0, high=256
    )
    bent_normals: bool = param(
        False, "bitmask: also find the mean unoccluded direction of each pixel, which auxiliary cameras do not change"
    )
    strength: float = param(1.0, "published: factor of the bounce, set by hand", low=0.0, high=1e3)
    nearest_distance: float = param(
        1.0,
        "published: least distance that counts between sender and receiver",
        low=0.0,
        high=1e30,
        above=True,
        unit="scene units",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in fields(self):
            value, methods = getattr(self, field.name), METHODS_OF.get(field.name, METHODS)
            if value != field.default and self.method not in methods:
                raise ValueError(
                    f"{field.name}={value:g} applies only to method="
                    f"{' or '.join(map(repr, methods))} (got method={self.method!r})"
                )

    @property
    def blur(self) -> BilateralParams:
        """Parameters of the blur of light."""
        return BilateralParams(radius=self.blur_radius, passes=self.blur_passes)

    def bitmask(self) -> SsdoBitmaskParams:
        """Return the parameters of the back end of "bitmask"."""
        return self._same(SsdoBitmaskParams)

    def points(self) -> PointsParams:
        """Return the parameters of the back end of "points" and "published"."""
        return self._same(PointsParams)

    def _same(self, params: type[P]) -> P:
        """Return parameters of another type with the values of the same names."""
        return params(**{name: getattr(self, name) for name in parameter_fields(params) if hasattr(self, name)})

    def back_end(self, size: Size, margin: Size) -> SsdoBitmaskParams | PointsParams:
        """Return the parameters of the method's back end for G-buffers of a size and margin."""
        if self.method != "bitmask":
            return self.points()
        # Taps are distributed over the arrays with margin, and keep the distances they have without.
        wider = 1.0 + sum(border / length for border, length in zip(margin, size, strict=True))
        return replace(self.bitmask(), taps=min(round(self.taps * wider), MOST_TAPS))

    def views(self) -> ViewsParams:
        """Return the parameters of auxiliary cameras: 4 taps in 2 directions of a slice, 16 in 4, 64 in 8."""
        return ViewsParams(strata=max(ViewsParams().strata, math.isqrt(self.view_taps)), taps=self.view_taps)

    def punctual_lights(self) -> LightShadowParams:
        """Return the parameters of shadows of lights that have no map."""
        return LightShadowParams(radius=self.radius, taps=self.shadow_taps)


class SsdoKeywords(OcclusionKeywords, total=False):
    """The other parameters of `ssdo`."""

    method: SsdoMethod
    bounce: bool
    emission: bool
    slices: int
    taps: int
    samples: int
    thickness: float
    view_taps: int
    shadow_taps: int
    bent_normals: bool
    strength: float
    nearest_distance: float
