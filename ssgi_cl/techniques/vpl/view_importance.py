"""View importance: irradiance that texels of reflective shadow maps give to the image, per watt."""

from __future__ import annotations

import numpy as np

from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.constants import VPL_MEANS
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA
from ssgi_cl.techniques.occupancy.occupancy_grid import TO_VIEW, Occupancy, packed_to_view
from ssgi_cl.techniques.vpl.flux_curve import CURVE, FluxCurve
from ssgi_cl.techniques.vpl.packed_vpls import VPL, packed_params

SUMS = VPL_MEANS


class ViewImportance:
    """Estimates the irradiance that a watt of each run of texels gives to what the camera sees.

    Virtual point lights in proportion to flux alone may lie where they light nothing that is seen:
    the roof of a house that is lit through its window. Those that do are then few, each of them
    has much flux, and their light is lost where surfaces are closer to them than they are wide.

    Source: Georgiev and Slusallek 2010, "Simple and Robust Iterative Importance Sampling of Virtual
    Point Lights"; here the importance only moves lights, whose flux stays that of the maps.
    """

    def __init__(self, runtime: Runtime) -> None:
        self.runtime = runtime
        self._importance: DeviceArray | None = None

    def run(self, gbuffer: DeviceGBuffer, curve: FluxCurve, *, occupancy: Occupancy) -> DeviceArray:
        """Queue the passes; return the importance of all runs, see kernels/vpl/curve.clh.

        Args:
            gbuffer: what the camera sees.
            curve: the latest sums along the maps.
            occupancy: what blocks light.
        """
        runtime, camera, runs = self.runtime, gbuffer.camera, curve.run_count
        assert camera is not None  # noqa: S101  a filled G-buffer has one
        if self._importance is None or self._importance.count != SUMS * runs + SUMS:
            self._importance = runtime.empty(SUMS * runs + SUMS, np.float32)
        structs = (CAMERA, VPL, CURVE, TO_VIEW)
        kernel = runtime.kernel("vpl/vpl_view_importance.cl", occupancy.macros, structs)
        for rsm, order, table, map_runs in curve.pieces():
            kernel.run(
                rsm.size,
                grid=(1, map_runs // runtime.variant.lanes),
                position=rsm.position,
                normal=rsm.normal,
                flux=rsm.flux,
                order=order,
                depth=gbuffer.depth,
                seen_normal=gbuffer.normal,
                importance=self._importance,
                camera=gbuffer.camera_struct,
                vpl=packed_params({"per_unit": 1.0 / occupancy.unit}, gbuffer.margin),
                params=table,
                turn=packed_to_view(rsm.to_view(camera)),
                columns=gbuffer.size[1],
                rows=gbuffer.size[0],
                **occupancy.arguments,
            )
        runtime.kernel("vpl/vpl_view_mean.cl").run(
            (runs, SUMS),
            grid=(1, -(-SUMS // runtime.variant.lanes)),
            local=runtime.small_groups(1),
            importance=self._importance,
        )
        return self._importance
