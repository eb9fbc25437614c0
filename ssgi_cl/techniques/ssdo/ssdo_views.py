"""Auxiliary cameras of SSDO: what they see in the directions that the first one leaves open."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.params import Params, param
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, rotation_values
from ssgi_cl.techniques.ao.slices import SliceParams, pattern
from ssgi_cl.techniques.source import Source
from ssgi_cl.techniques.ssdo.ssdo_views_unseen import UnseenDepth

EDGES = tuple(
    f"{side}_{axis}"
    for side, axes in (("left", "xzw"), ("right", "xzw"), ("top", "yzw"), ("bottom", "yzw"))
    for axis in axes
)
VIEWS = Struct(
    "ViewsParams",
    (
        *floats("radius", "most_px", "bias", "depth_bias", "nearest"),
        *floats(*ROTATION, "shift_x", "shift_y", "shift_z", *EDGES),
        *((name, "int") for name in ("columns", "rows", "margin_left", "margin_right", "margin_top", "margin_bottom")),
    ),
)

DEPTH_BIAS = 4e-6
"""Bias relative to depth: some roundings of float32 positions in two view spaces (2^-24 each)."""


@dataclass(frozen=True, kw_only=True)
class ViewsParams(Params):
    """Parameters of auxiliary cameras."""

    strata: int = param(2, "directions that are tried in each slice", low=1, high=16)
    taps: int = param(4, "depths read on the way in each direction", low=1, high=64)
    bias: float = param(
        0.2,
        "height above the tangent plane up to which nothing hides",
        low=0.0,
        high=100.0,
        unit="px of the other camera",
    )


class SsdoViews:
    """Adds what auxiliary cameras see to the result of `SsdoBitmask`, prepared for its parameters.

    Args:
        runtime: the device.
        slices: the parameters of the bitmask, of which radius and slices count here.
        params: see `ViewsParams`.
    """

    def __init__(self, runtime: Runtime, slices: SliceParams, params: ViewsParams | None = None) -> None:
        self.runtime = runtime
        self.slices = slices
        self.params = params or ViewsParams()
        self._table = runtime.array(slice_table(slices))
        self._unseen = UnseenDepth(runtime, slices.radius)

    def set(self, slices: SliceParams) -> None:
        """Take the values of other parameters of the bitmask, of the same shape."""
        self.slices = slices
        self._unseen.radius = slices.radius

    def begin(self, gbuffer: DeviceGBuffer) -> None:
        """Forget all views but the first one, whose G-buffer is given."""
        self._unseen.begin(gbuffer)

    def end(self) -> None:
        """Forget all views."""
        self._unseen.end()

    def add(
        self,
        light: Plane,
        masks: DeviceArray,
        gbuffer: DeviceGBuffer,
        source: Source,
        other: DeviceGBuffer,
        radiance: Plane | None,
    ) -> None:
        """Queue the passes of one auxiliary camera.

        Surfaces that a view since `begin` shows are left to it.

        Args:
            light: what `SsdoBitmask.run` returned: A shrinks, the last 3 images grow.
            masks: its `masks`, the sectors that are covered; those newly covered are added, and
                those whose sender is found are taken from the others.
            gbuffer: what it was made from; its camera counts.
            source: the same, or it reduced to the size of `light`.
            other: what the auxiliary camera sees, of any size and number of layers.
            radiance: of what it sees, 3 images for each layer, W m^-2 sr^-1; None if `light` has
                no bounce.
        """
        camera, further = gbuffer.camera, other.camera
        if camera is None or further is None:
            raise ValueError("a device G-buffer is empty: draw or upload something first")
        senders = 0 if radiance is None else min(radiance.count, other.normal.count) // 3
        params = self.params
        kernel = self.runtime.kernel(
            "ssdo/ssdo_views.cl",
            {
                "VIEWS_SLICES": self.slices.slices,
                "VIEWS_STRATA": params.strata,
                "VIEWS_TAPS": params.taps,
                "VIEWS_LAYERS": other.layers,
                "VIEWS_NORMALS": min(other.normal.count // 3, other.layers),
                "VIEWS_SENDERS": senders,
                "VIEWS_BOUNCE": max(light.count - 3, 1),
            },
            (CAMERA, VIEWS),
        )
        kernel.run(
            light.size,
            linear=source.linear,
            normal=source.normal,
            table=self._table,
            depth=self._unseen.of(other),
            seen=other.normal,
            radiance=radiance,
            light=light,
            masks=masks,
            camera=source.camera_struct,
            other=other.camera_struct,
            params=self._packed(light, gbuffer, source, other, camera, further),
        )

    def _packed(
        self,
        light: Plane,
        gbuffer: DeviceGBuffer,
        source: Source,
        other: DeviceGBuffer,
        camera: Camera,
        further: Camera,
    ) -> Any:
        rows, columns = light.size
        # In float64: both cameras may be far from the world's origin and near each other.
        turn = further.view[:3, :3] @ camera.view[:3, :3].T
        shift = further.view[:3, 3] - turn @ camera.view[:3, 3]
        step = getattr(source, "step", 1)
        return VIEWS.pack(
            {
                "radius": self.slices.radius,
                "most_px": self.slices.max_radius_px / step,
                "bias": self.params.bias,
                "depth_bias": DEPTH_BIAS,
                "nearest": 1e-3 * self.slices.radius,
                **rotation_values(turn),
                **dict(zip(("shift_x", "shift_y", "shift_z"), shift.tolist(), strict=True)),
                **_edges(further, other.margin),
                "columns": other.whole[1],
                "rows": other.whole[0],
                "margin_left": source.margin[1],
                "margin_right": source.whole[1] - columns - source.margin[1],
                "margin_top": source.margin[0],
                "margin_bottom": source.whole[0] - rows - source.margin[0],
            }
        )


def _edges(camera: Camera, margin: tuple[int, int]) -> Mapping[str, float]:
    """Return the planes through the edges of a camera's image, as distances that grow inwards."""
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    rows, columns = margin
    values: dict[str, float] = {}
    for axis, names, to, at, low, high in (
        ("x", ("left", "right"), to_x, at_x, -columns, camera.width + columns),
        ("y", ("bottom", "top"), to_y, at_y, -rows, camera.height + rows),
    ):
        for name, end, sign in zip(names, sorted((to * low + at, to * high + at)), (1.0, -1.0), strict=True):
            length = 1.0 if camera.is_orthographic else math.hypot(1.0, end)
            values[f"{name}_{axis}"] = sign / length
            values[f"{name}_z"] = 0.0 if camera.is_orthographic else sign * end / length
            values[f"{name}_w"] = -sign * end if camera.is_orthographic else 0.0
    return values


def slice_table(params: SliceParams) -> NDArray[np.float32]:
    """Return [4 rows, slices, 3, 16 columns] as kernels/ssdo/ssdo_views.cl reads it."""
    made = pattern(params)
    fields = np.stack([np.cos(made.angle), np.sin(made.angle), made.dither], axis=-1)
    return np.ascontiguousarray(np.tile(fields.transpose(0, 2, 3, 1), 4), np.float32)
