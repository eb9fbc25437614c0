"""Bent normals of GTAO: their time, and their angle to those of rays."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.techniques.ao.gtao import Gtao, GtaoParams
from ssgi_cl.tuning.case import Family, Own, Subject
from ssgi_cl.tuning.context import Context, exact

_SETTING = re.compile(r"([1-9]\d?)x([1-9]\d?)")


class BentNormals(Own):
    """GTAO with bent normals, A included; the setting is SLICESxTAPS, or "none".

    The image is the angle to the bent normal of rays, as many as the truth of A has: its mean is
    the bias, and its root mean square the RMSE. "none" is the surface's own normal in its place.
    """

    SETTINGS = ("none", "1x9", "2x9", "4x16")

    def prepare(self, context: Context, setting: str) -> Subject:
        """Make it ready."""
        match = _SETTING.fullmatch(setting)
        if match is None and setting != "none":
            raise ValueError(f"setting is {setting!r}: expected SLICESxTAPS, such as 2x9, or none")
        slices, taps = (int(match[1]), int(match[2])) if match else (1, 1)
        params = GtaoParams(radius=context.radius, slices=slices, taps=taps, bent_normals=True)
        technique = Gtao(context.runtime, context.size, params)
        gbuffer = context.gbuffer

        def angles() -> NDArray[np.float32]:
            if match:
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
            samples=2.0 * slices * taps * np.count_nonzero(context.seen) if match else 0.0,
            truths={"world": lambda: exact(np.zeros(context.size))},
            note="A included; RMSE and bias are of the angle to the bent normal of rays"
            if match
            else "the surface's normal: how far normals bend, so no time",
            timed=bool(match),
        )


FAMILIES: Mapping[str, Family] = {"bent-normals": BentNormals()}
