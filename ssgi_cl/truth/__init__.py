"""References that results are measured against: kept on disk, with their standard errors."""

from __future__ import annotations

from ssgi_cl.core.errors import TruthError
from ssgi_cl.truth import metrics as metrics  # `ssgi_cl.metrics` is looked for here
from ssgi_cl.truth.bent_normals import bent_normals
from ssgi_cl.truth.layers import layered_occlusion
from ssgi_cl.truth.light import direct_light, one_bounce
from ssgi_cl.truth.occlusion import ambient_occlusion
from ssgi_cl.truth.radiance import radiance
from ssgi_cl.truth.store import Truth

__all__ = [
    "Truth",
    "TruthError",
    "ambient_occlusion",
    "bent_normals",
    "direct_light",
    "layered_occlusion",
    "one_bounce",
    "radiance",
]


def __dir__() -> list[str]:
    return __all__
