"""Surfaces of an auxiliary view that no view before it shows."""

from __future__ import annotations

import math
from typing import Any

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, rotation_values

UNSEEN = Struct(
    "UnseenParams",
    (*floats(*ROTATION, "shift_x", "shift_y", "shift_z", "nearest"), *((name, "int") for name in ("columns", "rows"))),
)


class UnseenDepth:
    """Leaves each surface to the first view that shows it.

    Args:
        runtime: the device.
        radius: of the technique, scene units: points nearer to a camera than a thousandth of it
            have no image.
    """

    def __init__(self, runtime: Runtime, radius: float) -> None:
        self.runtime = runtime
        self.radius = radius
        # Cameras, on the device too, depth and normals of all views since `begin`.
        self._before: list[tuple[Camera, Any, Plane, Plane]] = []

    def begin(self, gbuffer: DeviceGBuffer) -> None:
        """Forget all views but the first one, whose G-buffer is given."""
        if gbuffer.camera is None:
            raise ValueError("a device G-buffer is empty: draw or upload something first")
        self._before = [(gbuffer.camera, gbuffer.camera_struct, gbuffer.depth, gbuffer.normal)]

    def end(self) -> None:
        """Forget all views."""
        self._before = []

    def of(self, view: DeviceGBuffer) -> Plane:
        """Queue the passes; return the view's depth, INFINITY where a view before it shows the
        surface.

        The view itself counts as one before the next.
        """
        camera = view.camera
        if camera is None:
            raise ValueError("a device G-buffer is empty: draw or upload something first")
        unseen = self.runtime.transient.plane(view.layers, view.whole, math.inf)
        unseen.copy_image(0, view.depth, view.layers)
        for earlier, earlier_struct, depth, normal in self._before:
            kernel = self.runtime.kernel(
                "ssdo/ssdo_views_unseen.cl",
                {
                    "UNSEEN_LAYERS": view.layers,
                    "UNSEEN_NORMALS": min(view.normal.count // 3, view.layers),
                    "SEEN_LAYERS": depth.count,
                    "SEEN_NORMALS": min(normal.count // 3, depth.count),
                },
                (CAMERA, UNSEEN),
            )
            kernel.run(
                view.whole,
                region=view.region,
                normal=view.normal,
                earlier=depth,
                facing=normal,
                depth=unseen,
                camera=view.camera_struct,
                before=earlier_struct,
                view=self._packed(camera, earlier, depth.size),
            )
        # The next view may be drawn to the same memory.
        kept_depth = self.runtime.transient.plane(view.layers, view.whole, math.inf)
        kept_normal = self.runtime.transient.plane(view.normal.count, view.whole)
        kept_depth.copy_image(0, view.depth, view.layers)
        kept_normal.copy_image(0, view.normal, view.normal.count)
        self._before.append((camera, view.camera_struct, kept_depth, kept_normal))
        return unseen

    def _packed(self, camera: Camera, earlier: Camera, size: Size) -> Any:
        # In float64: both cameras may be far from the world's origin and near each other.
        turn = earlier.view[:3, :3] @ camera.view[:3, :3].T
        shift = earlier.view[:3, 3] - turn @ camera.view[:3, 3]
        return UNSEEN.pack(
            {
                **rotation_values(turn),
                **dict(zip(("shift_x", "shift_y", "shift_z"), shift.tolist(), strict=True)),
                "nearest": 1e-3 * self.radius,
                "columns": size[1],
                "rows": size[0],
            }
        )
