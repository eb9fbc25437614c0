"""Same-assumption truth: what a technique tends to with ever more samples of its own model."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.progress import Progress, part_of, told
from ssgi_cl.reference.ao.ssao import planes, visibility
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.techniques.ao.ssao import SsaoParams, sample_points
from ssgi_cl.truth.digests import camera_description, digest
from ssgi_cl.truth.estimators import versioned
from ssgi_cl.truth.store import Truth, accumulated

PASS_POINTS = 128
"""Of a pass: within it, points that fall outside the image change what the others weigh."""
MOST_POINTS = 1 << 20

NOT_OF_THE_MODEL = (
    "radius",
    "samples",
    "max_samples",
    "near_px",
    "resolution",
    "blur_radius",
    "blur_passes",
    "contrast",
)
"""Parameters that say how well occlusion is sampled, not what it is; radius and contrast are told
apart."""


def ssao(
    gbuffer: GBuffer,
    params: SsaoParams | None = None,
    points: int = 1024,
    *,
    rebuild: bool = False,
    progress: Progress = None,
) -> Truth:
    """Return the A that SSAO tends to: many points, float64, full resolution, no blur.

    All pixels take the same points, so that neighbours err alike. Passes are stretches of one
    sequence. With several radii each is sampled on its own, and then the greatest occlusion counts.

    Args:
        gbuffer: depth, and normals if there are any.
        params: the occlusion model; numbers of samples, resolution and blur do not matter.
        points: per pixel and radius, 1 to 2^20; rounded up to a multiple of 128.
        rebuild: make it anew, whatever is kept.
        progress: called with the share that is done, which grows to 1. True: a bar in terminals and notebooks.

    Returns:
        Mean A [rows, columns] float32 in [0, 1] and its standard error, infinite from a single
        pass of 128 points; 1 where nothing is. In the hall, 400 x 300 pixels, 1024 points are off
        by 0.004 (RMS), as they say.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
        TruthError: what is kept is damaged; see `ssgi_cl.truth.store.accumulated`.
    """
    if not isinstance(gbuffer, GBuffer):
        raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected an ssgi_cl.GBuffer")
    params = params or SsaoParams()
    points = checks.integer("points", points, low=1, high=MOST_POINTS, unit="points per pixel")
    radii: tuple[float, ...] = params.radius  # type: ignore[assignment]
    passes = -(-points // PASS_POINTS)
    table = sample_points(passes * PASS_POINTS, params.length_power)
    view = SurfaceView.of(gbuffer)
    found = []
    with told(progress, "points") as tell:
        for index, radius in enumerate(radii):
            # A power of a mean is not the mean of powers: contrast comes last.
            single = replace(params, radius=(radius,), contrast=1.0)
            found.append(
                accumulated(
                    _description(gbuffer, single),
                    passes,
                    lambda number, single=single: visibility(  # type: ignore[misc]
                        view, single, table[PASS_POINTS * number : PASS_POINTS * (number + 1)]
                    ),
                    rebuild=rebuild,
                    progress=part_of(tell, index / len(radii), (index + 1) / len(radii)),
                )
            )
    truth = _contrasted(found[0] if len(found) == 1 else _darkest(found), params.contrast)
    share = planes(view, params)[1].astype(np.float32)
    return replace(truth, mean=truth.mean * share, error=truth.error * share)


def _contrasted(truth: Truth, exponent: float) -> Truth:
    """Return a truth whose mean is raised to a power."""
    if exponent == 1.0:
        return truth
    mean = (truth.mean**exponent).astype(np.float32)
    # Where A is 0, an exponent below 1 has no finite slope; and nowhere is A off by more than 1.
    slope = exponent * np.maximum(truth.mean, np.float32(1e-6)) ** (exponent - 1.0)
    known = np.isfinite(truth.error)
    error = np.where(known, np.minimum(truth.error * slope, 1.0), np.inf).astype(np.float32)
    return Truth(mean, error, truth.passes, digest(truth.key, exponent))


def _darkest(truths: list[Truth]) -> Truth:
    """Return, pixel by pixel, the one with the least mean."""
    means = np.stack([truth.mean for truth in truths])
    errors = np.stack([truth.error for truth in truths])
    least = np.argmin(means, axis=0)[None]
    mean: NDArray[np.float32] = np.take_along_axis(means, least, axis=0)[0]
    error: NDArray[np.float32] = np.take_along_axis(errors, least, axis=0)[0]
    return Truth(mean, error, truths[0].passes, digest(*(truth.key for truth in truths)))


def _description(gbuffer: GBuffer, params: SsaoParams) -> dict[str, object]:
    """Return what determines the estimates of a single radius."""
    values = asdict(params)
    (radius,) = values["radius"]
    return {
        "kind": "ssao",
        "camera": camera_description(gbuffer.camera),
        "gbuffer": digest(gbuffer.first("depth"), gbuffer.first("normal"), gbuffer.exact),
        "radius": radius,
        "points": PASS_POINTS,
        "model": {name: values[name] for name in values if name not in NOT_OF_THE_MODEL},
        "estimator": versioned("ssao"),
    }
