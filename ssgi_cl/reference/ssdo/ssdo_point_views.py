"""Auxiliary views of SSDO in float64, as `ssgi_cl.techniques.ssdo.ssdo_point_views` says."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.reference.ssdo.ssdo_points import NEAREST, Gathered, camera_of, gathered, layers_of, receivers

if TYPE_CHECKING:
    from ssgi_cl.techniques.ssdo.ssdo_points import PointsParams


def ssdo_point_views_reference(
    gbuffer: GBuffer,
    before: Gathered,
    other: GBuffer,
    radiance: ArrayLike | None,
    params: PointsParams,
    *,
    step: int = 1,
    sky: ArrayLike | None = None,
) -> Gathered:
    """Return what each step-th pixel gathers after an auxiliary camera; the model of the kernel.

    Args:
        gbuffer: what the first camera sees.
        before: what `ssdo_points_reference`, or this for another camera, returned.
        other: what the auxiliary camera sees.
        radiance: [layers, rows, columns, 3] of it with margin, or None.
        params: see `PointsParams`.
        step: 1, 2 or 4.
        sky: [rows, columns, 3], the image that `before` was made with, or None.
    """
    own = receivers(layers_of(gbuffer)[0], params, step)
    turn = other.camera.view[:3, :3] @ gbuffer.camera.view[:3, :3].T
    shift = other.camera.view[:3, 3] - turn @ gbuffer.camera.view[:3, 3]
    seen = replace(own, position=own.position @ turn.T + shift, normal=own.normal @ turn.T)
    nearest = NEAREST * params.radius
    camera = camera_of(other, radiance, auxiliary=True)
    return gathered(gbuffer, own, before, camera, seen, turn, nearest, params, sky)
