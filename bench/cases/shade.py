"""Direct light with shadows by the size of the shadow maps, and the frame as a whole."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.frame.render import render
from ssgi_cl.techniques.direct.shade import Shade
from ssgi_cl.tuning.case import Family, Own, Subject, count_of
from ssgi_cl.tuning.context import Context

from ..drawn import DrawnMaps
from .skips import MOVING

DRAWN = tuple(name for name in MOVING if name != "maps")
"""What may be left out of a frame whose lights move too."""


class Direct(Own):
    """Irradiance by the lights; the setting is the size of the shadow maps in texels."""

    SETTINGS = ("512", "1024", "2048")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make shadow maps and shading ready."""
        size = count_of(setting, "texels along a side", 16, 8192)
        if not context.punctual_lights:
            raise ValueError(f"{context.view.name} has no light: expected at least one")
        maps = DrawnMaps(context, size, flux=False)
        technique = Shade(context.runtime, context.size)
        seen = context.host_gbuffer
        white = DeviceGBuffer(context.runtime, context.size)
        white.upload(
            GBuffer(
                camera=context.camera,
                depth=seen.depth,
                normal=seen.normal,
                albedo=np.ones((*context.size, 3), np.float32),
            )
        )

        def image() -> NDArray[np.float32]:
            # A white surface of irradiance E has the radiance E / pi.
            radiance = technique.run(white, context.punctual_lights, shadows=maps.shadows()).download()
            return np.ascontiguousarray(np.float32(math.pi) * np.moveaxis(radiance, 0, -1))

        return Subject(
            run=image,
            image=image,
            quantity="direct",
            samples=9.0 * len(context.punctual_lights) * np.count_nonzero(context.seen),
            truths={"world": context.direct},
            counted="shadow maps drawn",
        )


class WholeFrame(Own):
    """Scene to picture: G-buffer, shadow maps, SSAO, shading, tone curve."""

    SETTINGS = ("16",)

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make the pipeline ready; the setting is the number of SSAO's samples."""
        samples = count_of(setting, "a number of samples of SSAO", 1, 256)
        view = context.view
        return Subject(
            run=lambda: render(
                view.scene,
                context.camera,
                view.lights,
                bounces=0,
                ao="ssao",
                ao_radius=context.radius,
                ao_samples=samples,
                skips=DRAWN,
                runtime=context.runtime,
            ),
            counted="the whole frame, light maps drawn",
        )


FAMILIES: Mapping[str, Family] = {"direct": Direct(), "frame-ssao": WholeFrame()}
