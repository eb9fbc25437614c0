"""Techniques of ambient occlusion under test, and how far kernels may be off their references."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.ao.bitmask_ao import bitmask_reference
from ssgi_cl.reference.ao.gtao import gtao_reference
from ssgi_cl.reference.ao.hbao import hbao_reference
from ssgi_cl.reference.ao.ssao import ssao_reference
from ssgi_cl.techniques.ao.bitmask import BitmaskAo, BitmaskParams
from ssgi_cl.techniques.ao.bitmask_ao import bitmask_ao
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams, gtao
from ssgi_cl.techniques.ao.hbao import Hbao, HbaoParams, hbao
from ssgi_cl.techniques.ao.occlusion import OcclusionParams, OcclusionTechnique
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams, ssao

RADIUS = 0.6
ROUNDING = 1e-5
"""Of A without blur. Slices: measured at most 6e-6 over all scenes and cameras; a horizon's
cotangent is rounded to some 1e-6. SSAO: a position is rounded to some 1e-6 radii, which the onset
of occlusion, 50 a radius steep, multiplies; one sample in 16 falls into it now and then."""
WEIGHTS = 1e-4
"""Of a blurred A: the error that kernels/common/lanes.clh states for a weight's power of two."""
FLIPS = 1e-3
"""Share of pixels in which a tap may fall to the next pixel, to the other side of the radius or
into the next sector, or a sample to the other side of a pixel's edge or a surface.

Measured: no tap in 57,000 pixels. A sample's place is rounded to about 2^-18 px, so that one in 1e5
reads the next pixel, which matters at edges only: 1 pixel of 573,400 over 200 images of 61 x 47. An
image of that size may have 2, one of 39 x 31 may have 1.
"""


@dataclass(frozen=True)
class Subject:
    """A technique under test."""

    function: Callable[..., NDArray[Any]]
    kind: type[OcclusionTechnique]
    params: type[OcclusionParams]
    reference: Callable[..., NDArray[Any]]

    def expected(self, gbuffer: GBuffer, **params: Any) -> NDArray[Any]:
        """Return A by the numpy reference, with `RADIUS` by default."""
        return self.reference(gbuffer, self.params(**{"radius": RADIUS, **params}))


SLICED = {
    "hbao": Subject(hbao, Hbao, HbaoParams, hbao_reference),
    "gtao": Subject(gtao, Gtao, GtaoParams, gtao_reference),
    "bitmask": Subject(bitmask_ao, BitmaskAo, BitmaskParams, bitmask_reference),
}
"""Those that scan slices."""
SUBJECTS = {"ssao": Subject(ssao, Ssao, SsaoParams, ssao_reference), **SLICED}
