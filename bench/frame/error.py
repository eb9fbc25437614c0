"""How far a frame is from its reference, as a screen shows both."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.rasterize.files.textures import srgb_to_linear
from ssgi_cl.techniques.filters.tonemap import auto_exposure
from ssgi_cl.truth import metrics

Floats = NDArray[np.float32]
Doubles = NDArray[np.float64]

SHOULDER = 0.25
"""Of the tone curve y = x / (1 + SHOULDER x)."""
GAMMA = 2.2


class FrameError(NamedTuple):
    """Errors of a frame.

    Attributes:
        flip: mean LDR-FLIP (Andersson et al. 2020) after the common tone curve.
        mrse: mean of (v - r)^2 / (r + 0.01)^2, of radiance.
        bias: mean difference over the reference's mean.
    """

    flip: float
    mrse: float
    bias: float


def frame_error(radiance: Floats, reference: Floats) -> FrameError:
    """Return the errors of radiance [rows, columns, 3]; the exposure is the reference's."""
    value, truth = (np.maximum(image, 0.0).astype(np.float64) for image in (radiance, reference))
    exposure = auto_exposure(reference)
    # FLIP wants linear light: what a screen makes of the encoded picture.
    shown = [srgb_to_linear(encoded(image, exposure)) for image in (value, truth)]
    mean = float(truth.mean())
    return FrameError(
        metrics.flip(*shown), metrics.mrse(value, truth), float((value - truth).mean()) / mean if mean > 0.0 else 0.0
    )


def encoded(radiance: NDArray[np.floating], exposure: float) -> Doubles:
    """Return the picture in [0, 1]: exposure, y = x / (1 + x / 4), clipped, gamma 2.2."""
    light = np.maximum(np.asarray(radiance, np.float64), 0.0) * exposure
    curve: Doubles = np.clip(light / (1.0 + SHOULDER * light), 0.0, 1.0) ** (1.0 / GAMMA)
    return curve
