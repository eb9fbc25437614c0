"""Ambient occlusion: SSAO, HBAO as published, bent normals, and the floor of depth layers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ssgi_cl import truth
from ssgi_cl.core import checks
from ssgi_cl.core.names import Resolution
from ssgi_cl.rasterize.raster.view import MOST_LAYERS, downloaded
from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams
from ssgi_cl.techniques.ao.hbao import Hbao, HbaoParams
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.ao.ssao import Ssao, SsaoParams
from ssgi_cl.truth import Truth, assumption
from ssgi_cl.tuning.case import Family, Subject, count_of, counts_of
from ssgi_cl.tuning.choose import choose
from ssgi_cl.tuning.context import Context, exact

from ..peers.extras import missing_package

PIXEL_BYTES = 4 * (1 + 3 + 1)
"""Depth and normal read, A written."""

BLUR = SsaoParams().blur_radius
"""Radius of SSAO's own blur, px."""
SAMPLES = ("4", "8", "16", "32", "64", "128")

LECTURE = "6x6"
"""Directions and steps."""

_BENT = re.compile(r"([1-9]\d?)x([1-9]\d?)|none")
_FLOOR = re.compile(r"([1-9]\d?)(?:-([1-9]\d?))?")


def ssao(context: Context, setting: str, *, blur_radius: int = 0, resolution: Resolution = "full") -> Subject:
    """Make SSAO ready; the setting is the number of samples. `blur_radius` 0: no blur."""
    samples = count_of(setting, "a number of samples per pixel", 1, 256)
    params = SsaoParams(radius=context.radius, samples=samples, blur_radius=blur_radius, resolution=resolution)
    return ssao_subject(context, params)


def ssao_preset(context: Context, setting: str) -> Subject:
    """Make SSAO ready; the setting is the name of its preset."""
    return ssao_subject(context, choose("ssao", context.size, preset=setting, radius=context.radius).params)


def ssao_subject(context: Context, params: SsaoParams) -> Subject:
    """Return SSAO with any parameters as a subject."""
    technique = Ssao(context.runtime, context.size, params)
    gbuffer = context.gbuffer
    model = replace(params, blur_radius=0, resolution="full", samples=16, max_samples=0)

    def converged() -> Truth:
        return context.truth(
            f"points of SSAO's model on {context.view.name}: {model}",
            assumption.ssao,
            context.host_gbuffer,
            model,
            context.truths.points,
        )

    return Subject.of_image(
        lambda: technique(gbuffer),
        quantity="occlusion",
        samples=context.surface_pixels / RESOLUTIONS[params.resolution] ** 2 * params.samples,
        moved=context.pixels * PIXEL_BYTES,
        truths={"world": context.occlusion, "assumption": converged},
    )


def lecture(context: Context, setting: str) -> Subject:
    """Make HBAO with the setting of its publication ready (Bavoil and Sainz 2008).

    6 directions of 6 steps at half size, blurred with 15 x 15 pixels at full size. The case gives
    the size; that of the publication was 1600 x 1200.
    """
    checks.choice("setting", setting, (LECTURE,))
    params = HbaoParams(
        radius=context.radius,
        slices=3,
        taps=6,
        resolution="half",
        blur_radius=7,
        blur_resolution="full",
        attenuation=1.0,
    )
    technique = Hbao(context.runtime, context.size, params)
    gbuffer = context.gbuffer
    return Subject.of_image(
        lambda: technique(gbuffer),
        quantity="occlusion",
        samples=36.0 / 4.0 * context.surface_pixels,
        moved=context.pixels * PIXEL_BYTES,
        truths={"world": context.occlusion},
        note="AO at half size, 15 x 15 blur at full size; at 1600 x 1200 a GTX 280 took 3.5 + 2.5 ms in 2008",
    )


def bent_normals(context: Context, setting: str) -> Subject:
    """Make GTAO with bent normals ready, A included; the setting is SLICESxTAPS, or "none".

    The image is the angle to the bent normal of rays, as many as the truth of A has: its mean is
    the bias, and its root mean square the RMSE. "none" is the surface's own normal in its place.
    """
    bent = setting != "none"
    slices, taps = (int(part or 1) for part in counts_of(setting, _BENT, "SLICESxTAPS, such as 2x9, or none"))
    params = GtaoParams(radius=context.radius, slices=slices, taps=taps, bent_normals=True)
    technique = Gtao(context.runtime, context.size, params)
    gbuffer = context.gbuffer

    def angles() -> NDArray[np.float32]:
        if bent:
            found = technique.both(gbuffer)[1]
        else:
            normal = context.host_gbuffer.first("normal")
            assert normal is not None  # noqa: S101  the rasteriser draws them
            found = context.host_gbuffer.inner(normal)
        # Exact for small angles, where the cosine is not.
        half = 0.5 * np.linalg.norm(found - context.bent_normals().mean, axis=-1)
        angle: NDArray[np.float32] = np.degrees(2.0 * np.arcsin(np.minimum(half, 1.0)))
        return np.where(context.seen, angle, 0.0).astype(np.float32)

    return Subject(
        run=lambda: technique.both(gbuffer),
        image=angles,
        quantity="bent",
        samples=2.0 * slices * taps * context.surface_pixels if bent else 0.0,
        truths={"world": lambda: exact(np.zeros(context.size))},
        note="A included; RMSE and bias are of the angle to the bent normal of rays"
        if bent
        else "the surface's normal: how far normals bend, so no time",
        timed=bent,
    )


def floor(context: Context, setting: str) -> Subject:
    """Draw depth layers to cast rays against; the setting is LAYERS, or LAYERS-OVERSCAN in per cent.

    How wrong ambient occlusion is that knows what the layers hold, and does not guess: a bound, not
    a technique. Rays are as many as the world truth's, in the same directions, so that the noise of
    both cancels. Guesses may get below it: techniques that take what is behind a surface for solid
    do so in places, with one layer.
    """
    expected = f"LAYERS or LAYERS-OVERSCAN, 1 to {MOST_LAYERS} layers and 1 to 99 % of overscan, such as 2-10"
    layers, overscan = (int(part or 0) for part in counts_of(setting, _FLOOR, expected))
    if layers > MOST_LAYERS:
        raise ValueError(f"setting is {setting!r}: expected {expected}")
    gbuffer = downloaded(context.layered(layers, 0.01 * overscan))

    def found() -> Truth:
        return context.truth(
            f"rays against {setting} of {context.view.name}",
            truth.layered_occlusion,
            gbuffer,
            context.radius,
            context.truths.rays,
            attenuation=context.truths.attenuation,
        )

    return Subject(
        run=found,
        image=lambda: found().mean,
        on_device=False,
        quantity="occlusion",
        truths={"world": context.occlusion},
        note="rays against what the depth layers hold: a bound, so no time",
        timed=False,
    )


FAMILIES: Mapping[str, Family] = {
    "ssao": Family(ssao, SAMPLES),
    "ssao-blur": Family(partial(ssao, blur_radius=BLUR), SAMPLES),
    "ssao-half": Family(partial(ssao, blur_radius=BLUR, resolution="half"), SAMPLES),
    "ssao-preset": Family(ssao_preset, ("low", "medium", "high", "ultra")),
    "bent-normals": Family(bent_normals, ("none", "1x9", "2x9", "4x16")),
    "lecture": Family(lecture, (LECTURE,)),
    "floor": Family(
        floor, ("1", "2", "4", "1-10", "2-10", "4-10"), missing=lambda: missing_package("embreex", "truth")
    ),
}
