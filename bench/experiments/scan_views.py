"""Directional occlusion with auxiliary cameras against path tracing, by the taps that it reads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.drawn import DrawnMaps
from ssgi_cl.frame.auxiliary_views import AuxiliaryViews
from ssgi_cl.techniques.ssdo.ssdo import Ssdo
from ssgi_cl.techniques.ssdo.ssdo_params import SsdoParams
from ssgi_cl.tuning.context import Context

from .scan import Measured, Scan

CAMERAS = 2
"""Auxiliary cameras, of half the size."""
MAP_SIZE = 1024


def view_errors(context: Context, values: Mapping[str, Any]) -> Measured:
    """Return RMSE in percent of the mean of the bounce, and taps of auxiliary views per pixel.

    Surfaces send light however far away they are, as in the truth; the taps are those of directions
    that are all open, which is the most that there can be.

    Args:
        context: the scene; its punctual lights count.
        values: parameters of `SsdoParams`, and `cameras`, how many of them.
    """
    given = {**values}
    cameras = given.pop("cameras", CAMERAS)
    bounds = context.view.scene.bounds
    radius = float(np.linalg.norm(bounds[1] - bounds[0]))
    params = SsdoParams(**{"radius": radius, "resolution": "full", **given})
    image = _bounce(context, params, cameras)
    truth = context.bounce().mean
    seen = context.seen
    rmse = float(np.sqrt(np.mean((image - truth)[seen] ** 2, dtype=np.float64)))
    views = params.views()
    taps = cameras * params.slices * views.strata * views.taps
    return Measured(100.0 * rmse / max(float(truth[seen].mean()), 1e-30), float(taps))


def _bounce(context: Context, params: SsdoParams, cameras: int) -> NDArray[np.float32]:
    """Return irradiance [rows, columns, 3] by light that surfaces reflect, W/m^2."""
    runtime = context.runtime
    gbuffer = context.gbuffer
    gbuffer.emits = False  # the truth is of lights alone
    technique = Ssdo(runtime, context.size, params, gbuffer.margin, 1, 1)
    maps = context.shared("shadow maps", lambda: DrawnMaps(context, MAP_SIZE, flux=False))
    further = AuxiliaryViews(runtime, cameras)

    def dark(views: Any) -> Any:
        for view in views:
            view.emits = False
            yield view

    with runtime.frame():
        shadows = maps.shadows()
        views = further.drawn(context.view.scene, context.camera, gbuffer, context.punctual_lights)
        bounce = technique.run(
            gbuffer, context.punctual_lights, shadows=shadows, auxiliary_views=dark(views) if cameras else ()
        ).bounce
        if bounce is None:
            return np.zeros((*context.size, 3), np.float32)
        return np.ascontiguousarray(np.moveaxis(bounce.download(), 0, -1))


SCANS: Mapping[str, Scan] = {
    "ssdo_views": Scan(view_errors, "RMSE (% of the mean)", "taps of auxiliary views per pixel")
}
