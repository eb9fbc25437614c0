"""Further cameras of SSDO from taps: what they see round each pixel that no camera before them did.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ssgi_cl.camera import Camera
from ssgi_cl.device_gbuffer import DeviceGBuffer
from ssgi_cl.memory import Plane
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import CAMERA, ROTATION, Struct, floats, rotation_values
from ssgi_cl.techniques.lit_layers import SenderRecords
from ssgi_cl.techniques.ssdo_points import POINTS, SsdoPoints

POINT_VIEWS = Struct(
    "PointViewsParams",
    (
        *floats(*ROTATION, "shift_x", "shift_y", "shift_z", "nearest"),
        *((name, "int") for name in ("columns", "rows", "layer")),
    ),
)


class SsdoPointViews:
    """Adds what further cameras see to the result of `SsdoPoints`.

    Args:
        runtime: the device.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        # Cameras, on the device too, their depth, and layers of it that send.
        self._before: list[tuple[Any, Any, Plane, int]] = []
        self._kept: dict[Any, Plane] = {}
        self._nothing = runtime.plane(1, (1, 1))
        self._no_senders = runtime.array(np.zeros(1, np.int32))

    def begin(self, gbuffer: DeviceGBuffer) -> None:
        """Forget all cameras but the first one, whose G-buffer is given."""
        self._before = [
            (gbuffer.camera, gbuffer.camera_struct, gbuffer.depth, gbuffer.attributes)
        ]

    def add(
        self,
        light: Plane,
        points: SsdoPoints,
        gbuffer: DeviceGBuffer,
        other: DeviceGBuffer,
        records: SenderRecords | None,
    ) -> None:
        """Queue the passes of one further camera.

        Args:
            light: what `points` returned: A shrinks, the sky's irradiance with it, the last 3
                images grow.
            points: with `kept`, the taps that hide, to which those are added that are found to.
            gbuffer: what it was made from.
            other: what the further camera sees, of any size and number of layers.
            records: of what it sees; surfaces in them that a camera since `begin` shows become
                dark. None if `light` has no bounce or all is dark.
        """
        if gbuffer.camera is None or other.camera is None:
            raise ValueError("a device G-buffer is empty: draw or upload something first")
        if points.kept is None or points.wide_taps is None:
            raise ValueError("points keeps no taps: expected one that was made with kept=True")
        if records is not None and not points.bounces:
            raise ValueError("there are records: expected None, as points gathered no bounce")
        if records is not None:
            self._darken(other, records, points.params.radius)
        kernel = self.runtime.kernel(
            "ssdo_point_views/ssdo_point_views.cl",
            {
                "POINT_VIEWS_COUNT": points.params.samples,
                "POINT_VIEWS_LAYERS": other.layers,
                "POINT_VIEWS_SENDERS": 0 if records is None else records.layers,
                "POINT_VIEWS_STEP": points.step,
                "POINT_VIEWS_SKY": int(light.count > 1 + 3 * points.bounces),
                "POINT_VIEWS_PAPER": int(points.params.area == "paper"),
                "POINT_VIEWS_THICKNESS": int(other.thickness is not None),
            },
            (CAMERA, POINTS, POINT_VIEWS),
        )
        kernel.run(
            "ssdo view",
            light.size,
            reads=[
                gbuffer.depth, gbuffer.normal, points.wide_taps, other.depth,
                other.thickness or self._nothing,
                self._no_senders if records is None else records.array,
            ],
            writes=[light, points.kept],
            values=[
                gbuffer.camera_struct, other.camera_struct, points.packed(gbuffer),
                _packed(gbuffer.camera, other.camera, other.whole, points.params.radius),
            ],
        )

    def _darken(self, other: DeviceGBuffer, records: SenderRecords, radius: float) -> None:
        """Queue the passes that leave each surface to the first camera that shows it."""
        assert other.camera is not None  # noqa: S101  asked for above
        for camera, camera_struct, depth, layers in self._before:
            kernel = self.runtime.kernel(
                "ssdo_point_views/ssdo_point_seen.cl", {"SEEN_LAYERS": layers},
                (CAMERA, POINT_VIEWS),
            )
            for layer in range(records.layers):
                kernel.run(
                    "ssdo seen",
                    other.whole,
                    reads=[other.depth, other.normal, depth],
                    writes=[records.array],
                    values=[
                        other.camera_struct, camera_struct,
                        _packed(other.camera, camera, depth.size, radius, layer),
                    ],
                )
        # The next camera may be drawn to the same memory.
        key = len(self._before), other.whole, records.layers
        if key not in self._kept:
            self._kept[key] = self.runtime.plane(records.layers, other.whole)
        self._kept[key].copy_image(0, other.depth, records.layers)
        self._before.append(
            (other.camera, other.camera_struct, self._kept[key], records.layers)
        )


def _packed(camera: Camera, further: Camera, whole: Any, radius: float, layer: int = 0) -> Any:
    # In float64: both cameras may be far from the world's origin and near each other.
    turn = further.view[:3, :3] @ camera.view[:3, :3].T
    shift = further.view[:3, 3] - turn @ camera.view[:3, 3]
    return POINT_VIEWS.pack(
        {
            **rotation_values(turn),
            **dict(zip(("shift_x", "shift_y", "shift_z"), shift.tolist(), strict=True)),
            "nearest": 1e-3 * radius,
            "columns": whole[1],
            "rows": whole[0],
            "layer": layer,
        }
    )
