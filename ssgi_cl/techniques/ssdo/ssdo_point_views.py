"""Auxiliary views of SSDO from directions: what they show that no camera before them did."""

from __future__ import annotations

from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, rotation_values
from ssgi_cl.techniques.direct.layer_shading import SenderRecords
from ssgi_cl.techniques.ssdo.ssdo_points import POINTS, SsdoPoints

POINT_VIEWS = Struct(
    "PointViewsParams",
    (*floats(*ROTATION, "shift_x", "shift_y", "shift_z", "nearest"), *((name, "int") for name in ("columns", "rows"))),
)


class SsdoPointViews:
    """Adds what auxiliary cameras see to the result of `SsdoPoints`.

    A direction that has met a surface is done with, so no view makes light: each view only turns
    open directions into ones that meet what it shows.

    Args:
        runtime: the device.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime

    def add(
        self,
        light: Plane,
        points: SsdoPoints,
        gbuffer: DeviceGBuffer,
        other: DeviceGBuffer,
        records: SenderRecords | None,
    ) -> None:
        """Queue the passes of one auxiliary camera.

        Args:
            light: what `points` returned: A and the sky's irradiance shrink, the last 3 images
                grow.
            points: with `kept`, the directions that met something, to which more are added.
            gbuffer: what it was made from.
            other: what the auxiliary camera sees, of any size and number of layers.
            records: what its surfaces send. None if `light` has no bounce or all is dark.
        """
        if gbuffer.camera is None or other.camera is None:
            raise ValueError("a device G-buffer is empty: draw or upload something first")
        if points.kept is None or points.wide_directions is None:
            raise ValueError("points keeps no directions: expected one that was made with kept=True")
        if records is not None and not points.bounces:
            raise ValueError("there are records: expected None, as points gathered no bounce")
        kernel = self.runtime.kernel(
            "ssdo/ssdo_point_views.cl",
            {
                "POINT_VIEWS_COUNT": points.params.samples,
                "POINTS_TAPS": points.params.taps,
                "POINTS_LAYERS": other.layers,
                "POINT_VIEWS_SENDERS": 0 if records is None else records.layers,
                "POINT_VIEWS_STEP": points.step,
                "POINT_VIEWS_SKY": int(light.count > 1 + 3 * points.bounces),
                "POINTS_PUBLISHED": int(points.params.method == "published"),
                "POINTS_THICKNESS": points.params.thickness_of(other.thickness),
            },
            (CAMERA, POINTS, POINT_VIEWS),
        )
        kernel.run(
            light.size,
            depth=gbuffer.depth,
            normal=gbuffer.normal,
            directions=points.wide_directions,
            planes=points.planes_of(other, other.layers),
            thickness=other.thickness,
            senders=None if records is None else records.array,
            gathered=light,
            kept=points.kept,
            camera=gbuffer.camera_struct,
            other=other.camera_struct,
            params=points.packed(gbuffer),
            view=_packed(gbuffer.camera, other.camera, other.whole, points.params.radius),
        )


def _packed(camera: Camera, other: Camera, whole: Any, radius: float) -> Any:
    # In float64: both cameras may be far from the world's origin and near each other.
    turn = other.view[:3, :3] @ camera.view[:3, :3].T
    shift = other.view[:3, 3] - turn @ camera.view[:3, 3]
    return POINT_VIEWS.pack(
        {
            **rotation_values(turn),
            **dict(zip(("shift_x", "shift_y", "shift_z"), shift.tolist(), strict=True)),
            "nearest": 1e-3 * radius,
            "columns": whole[1],
            "rows": whole[0],
        }
    )
