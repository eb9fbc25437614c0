"""Gathering from reflective shadow maps by the number of samples: how drawn, at what size, and as published."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.names import GatherResolution
from ssgi_cl.techniques.rsm.rsm_gather import RsmGather, RsmGatherParams
from ssgi_cl.techniques.rsm.rsm_published import RsmPublished, RsmPublishedParams
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps

MAP_SIZE = 512
"""Texels along a side of each map."""

READS = 10
"""Scattered reads of a sample, where pixels do not share it."""

SETTINGS = ("100", "400", "1600")


def gathered(
    context: Context, setting: str, *, pattern: str = "flux", resolution: GatherResolution = "full"
) -> Subject:
    """Make irradiance by one bounce of all lights ready; the setting is the number of samples of each."""
    samples = count_of(setting, "a number of samples", 1, 65536)
    params = RsmGatherParams(samples=samples, pattern=pattern, resolution=resolution)
    technique = RsmGather(context.runtime, context.size, params)
    image = _image(context, technique)
    pixels, note = context.surface_pixels, ""
    if resolution != "full":
        image()
        pixels = int(technique.computed * pixels)
        note = f"{100.0 * technique.computed:.1f} % of the pixels computed"
    # Samples that are the same for all pixels need no scattered reads.
    reads = 0.0 if pattern == "flux" else READS * pixels * samples * len(context.punctual_lights)
    return _subject(context, image, reads, f"{DrawnMaps.counted}, samples drawn", note)


def published(context: Context, setting: str) -> Subject:
    """Make the same as published ready."""
    samples = count_of(setting, "a number of samples", 1, 65536)
    technique = RsmPublished(context.runtime, context.size, RsmPublishedParams(samples=samples))
    image = _image(context, technique)
    image()
    reads = READS * int(technique.computed * context.pixels) * samples * len(context.punctual_lights)
    note = f"{100 * technique.computed:.1f} % of the pixels gathered for"
    return _subject(context, image, reads, DrawnMaps.counted, note)


def _image(context: Context, technique: RsmGather | RsmPublished) -> Callable[[], NDArray[np.float32]]:
    """Return what gathers from a map of each light; the published pattern projects a pixel into one."""
    drawn = [DrawnMaps(context, MAP_SIZE, punctual_lights=[light]) for light in context.some_lights()]
    gbuffer = context.gbuffer
    return lambda: technique(gbuffer, [rsm for maps in drawn for rsm in maps.reflective()])


def _subject(
    context: Context, image: Callable[[], NDArray[np.float32]], reads: float, counted: str, note: str
) -> Subject:
    return Subject.of_image(
        image,
        quantity="bounce",
        samples=float(reads),
        truths={"world": context.bounce, "assumption": context.unblocked_bounce},
        counted=counted,
        note=note,
    )


FAMILIES: Mapping[str, Family] = {
    "rsm-gather": Family(gathered, (*SETTINGS, "6400")),
    "rsm-gather-adaptive": Family(partial(gathered, resolution="adaptive"), (*SETTINGS, "6400")),
    "rsm-gather-disk": Family(partial(gathered, pattern="fixed"), SETTINGS),
    "rsm-gather-disk-adaptive": Family(partial(gathered, pattern="fixed", resolution="adaptive"), SETTINGS),
    "rsm-gather-published": Family(published, SETTINGS),
}
