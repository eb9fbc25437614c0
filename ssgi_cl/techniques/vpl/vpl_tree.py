"""Light tree over virtual point lights, and its cuts: few lights stand for many."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.vpls import PARTS
from ssgi_cl.device.arrays import DeviceArray, Plane, Size
from ssgi_cl.device.constants import (
    CUT_BRIGHT,
    CUT_GROUP,
    CUT_SAMPLE,
    CUT_SHARED,
    SSGI_GROUP,
    TREE_BOUNDS,
    TREE_LEAF,
    TREE_RECORD,
)
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats, ints
from ssgi_cl.techniques.occupancy.occupancy_grid import Occupancy, OccupancyGrid
from ssgi_cl.techniques.occupancy.scene_rays import SCENE_RAYS, SceneRays
from ssgi_cl.techniques.vpl.kept_order import KeptOrder
from ssgi_cl.techniques.vpl.packed_vpls import VPL, DeviceVpls, packed_params

CUT = Struct("CutParams", (*ints("first", "groups", "segments", "lights"), *floats("scale", "faint", "bright")))

RECORD, BOUNDS, LEAF = TREE_RECORD, TREE_BOUNDS, TREE_LEAF
GROUP, SAMPLE = CUT_GROUP, CUT_SAMPLE
SAMPLES = 1024
"""Samples from which the mean irradiance is estimated; a multiple of every number of lanes."""
LISTED = 1 << 23
"""Places of the lists of one pass, and floats of its samples, which bounds their memory."""
ROWS = 4
"""Times so many samples as a work-item has lanes: each light is read once for all of them.
With visibility half of them, as shadow rays need registers; on GPUs one, whose work-groups read lights together."""
SHARES = (4, 16, 64)
"""Lights that may share a shadow ray: those of a run."""
BRIGHT = 0.35
"""Part of the error allowed of clusters: of 16 lights that send more, every 4 have a shadow ray.
FLIP of whole frames of 400 x 300, without it and with: parlour .095 and .090, hall .151 and .148,
workshop .169 and .167, terrace .060 and .060; kept frames take 7 to 17 % more indoors, and as long
as before outdoors. 4 lights for every ray give .090, .146, .168 and .060 in 1.2 to 1.7 times the
time."""
FAINT = 0.25
"""Part of the error allowed of clusters: 64 lights that send less have one shadow ray. In whole
frames of 400 x 300, 0.5 raises the FLIP of the parlour from .119 to .129. Where all light is 5
times that of the lights it is up to twice as much: the terrace takes 10 % less time for the same
FLIP, the Japanese garden 8 % for .035 in place of .034."""
CPU_ITEMS = 8
"""Work-items for each core that take pieces in turn, since the host doesn't know how many there
are. With 128 a core, starting them takes as long as what they do."""


class Samples(Protocol):
    """The surface under a plane of values: a G-buffer, or one that was reduced."""

    size: Size
    margin: Size
    depth: Plane
    normal: Plane
    camera_struct: Any


class VplTree:
    """A tree over lights, and the light of it on lists of samples.

    Args:
        runtime: the device.
        lights: what the tree is made of; without subsets. Parts of lights are not in the tree:
            they shine in place of a near light that is listed.
        near, cut: VPL_NEAR and VPL_CUT of kernels/vpl/light.clh.
        grid: of what blocks light; None: nothing does.
        share: lights that share a shadow ray, one of `SHARES`.

    Attributes:
        limits: [3] allowed errors in W/m^2, of interpolation and of clusters of lights, and all light
            over that of the lights; see `measure`.
    """

    def __init__(
        self,
        runtime: Runtime,
        lights: DeviceVpls,
        near: int,
        cut: int,
        grid: OccupancyGrid | None = None,
        share: int = 16,
    ) -> None:
        self.runtime = runtime
        self.lights = lights
        stride, segments = lights.stride, lights.segments
        width = -(-(stride // 16) // 16) * 16
        self._runs = stride // 4 + stride // 16 + -(-stride // 64)
        bounds = LEAF * stride + 6 * BOUNDS * width
        self._records = runtime.empty(segments * (stride + self._runs) * RECORD, np.float32)
        # What lies past the last light is read with it, and left out.
        self._bounds = runtime.array(np.zeros(segments * bounds, np.float32))
        self._found = runtime.empty(2 * SAMPLES, np.float32)
        self.limits = runtime.empty(3, np.float32)
        # A GPU takes all batches at once: it would wait for each that does not fill it.
        self._at_once = lights.segments if runtime.info.kind == "gpu" else 1
        self._most_groups = max(LISTED // max(lights.capacity * self._at_once, GROUP * SAMPLE), 1)
        self._lists = self._counts = runtime.empty(0, np.int32)
        self._kept = runtime.empty(0, np.float32)
        self._groups = 0  # that there is room for
        macros = self._light_macros = {"VPL_NEAR": near, "VPL_CUT": cut}
        self._make_runs = runtime.kernel("multires/cluster_means.cl", {}, (CAMERA, VPL))
        self._limits = runtime.kernel("multires/cut_limits.cl")
        # A GPU has a work-item for each sample: few groups would not fill it.
        is_gpu = runtime.info.kind == "gpu"
        self._items = GROUP if is_gpu else 1
        self._cut = runtime.kernel("multires/cut_lists.cl", {"CUT_ITEMS": self._items}, (CAMERA, VPL, CUT))
        self._rows = 1 if is_gpu else ROWS // 2 if grid else ROWS
        macros = macros | {
            "SHADE_ROWS": self._rows,
            "VPL_VISIBILITY": int(grid is not None),
            "SHADE_LINE": SHARES.index(share) + 1,
        }
        # Without visibility the kernel does not look at the grid.
        macros |= grid.macros if grid else {"OCCUPANCY_CELLS": 32}
        self._macros = macros

    def reserve(self, most: int) -> None:
        """Make room for the lists of `most` samples, or of as many as a pass takes."""
        groups = min(-(-most // GROUP), self._most_groups)
        if self._groups < groups:
            self._groups = groups
            self._lists = self.runtime.empty(self._at_once * groups * self.lights.capacity, np.int32)
            self._counts = self.runtime.empty(self._at_once * groups, np.int32)
            self._kept = self.runtime.empty(groups * GROUP * SAMPLE, np.float32)

    def update(self, order: KeptOrder | None = None) -> None:
        """Queue the passes that make the tree from the lights that there are now.

        Args:
            order: of the frame before, in a sequence; it is changed.
        """
        packed, total = self._packed({}, (0, 0)), np.int32(self.lights.count)
        segments = self.lights.segments
        places = segments * self.lights.stride
        axes, kept = (None, 0) if order is None else order.axes(self.runtime, places)
        by: dict[str, Any] = {} if axes is None else {"axes": axes}
        self.runtime.kernel("multires/cluster_order.cl", {"CLUSTER_AXES": kept}, (CAMERA, VPL)).run(
            (1, 1),
            grid=(1, segments * SSGI_GROUP),
            local=(1, SSGI_GROUP),
            lights=self.lights.lights,
            records=self._records,
            bounds=self._bounds,
            params=packed,
            total=total,
            parts=PARTS if self.lights.parted else 0,
            **by,
        )
        self._make_runs.run(
            (1, 1),
            grid=(segments, self._runs),
            local=self.runtime.small_groups(8),
            records=self._records,
            bounds=self._bounds,
            params=packed,
            total=total,
        )

    def measure(
        self,
        source: Samples,
        samples: DeviceArray,
        values: dict[str, float],
        interpolation: float,
        runs: float,
        other_light: Sequence[Plane] = (),
    ) -> None:
        """Queue the passes that set `limits` to shares of the samples' mean irradiance.

        The mean of `SAMPLES` of them, lit by 64 or more clusters of lights where there are as many, and
        by `other_light`, up to three planes of irradiance in W/m^2 of a multiple of the source's size.
        """
        others: dict[str, Any] = {}
        for number, plane in enumerate(other_light):
            others[f"other{number}"], others[f"plane{number}"] = plane, plane.size
            others[f"side{number}"] = max(-(-plane.size[i] // source.size[i]) for i in (0, 1))
        macros = {**self._light_macros, "CUT_OTHERS": len(other_light)}
        self.runtime.kernel("multires/cut_mean.cl", macros, (CAMERA, VPL)).run(
            source.size,
            grid=(1, SAMPLES // self.runtime.variant.lanes),
            local=self.runtime.small_groups(4),
            depth=source.depth,
            normal=source.normal,
            list=samples,
            records=self._records,
            found=self._found,
            camera=source.camera_struct,
            params=self._packed(values, source.margin),
            total=self.lights.count,
            wanted=SAMPLES,
            **others,
        )
        self._limits.run(
            (1, 1),
            grid=(1, SSGI_GROUP),
            local=(1, SSGI_GROUP),
            found=self._found,
            limits=self.limits,
            count=SAMPLES,
            interpolation=interpolation,
            runs=runs,
            others=min(len(other_light), 1),
        )

    def shine(
        self,
        source: Samples,
        samples: DeviceArray,
        most: int,
        fractions: Plane,
        result: Plane,
        values: dict[str, float],
        occupancy: Occupancy | None = None,
        rays: SceneRays | None = None,
    ) -> None:
        """Queue the passes that add shares of the irradiance of the samples to a plane.

        Args:
            source: the surfaces that light falls on.
            samples: how many there are, and so many times row << 16 | column.
            most: of them, at most; `reserve` made room for so many.
            fractions: of the source's size.
            result: 3 images likewise, W/m^2; other pixels stay as they are.
            values: members of the struct `VPL` that depend on the technique.
            occupancy: what blocks light, if this was made with a grid.
            rays: what blocks light in place of it.
        """
        lanes, is_gpu = self.runtime.variant.lanes, self.runtime.info.kind == "gpu"
        items = 1 << 30 if is_gpu else CPU_ITEMS * self.runtime.device.max_compute_units
        local = self.runtime.small_groups(1)
        pieces = GROUP // (self._rows * lanes)
        # Light too weak for a float32 is 0, and so is what may be left out of it.
        groups = -(-most // GROUP)
        scale = 1.0 / max(self.lights.values["gain"], float(np.finfo(np.float32).tiny))
        parted = self.lights.parted and values.get("refine", 0.0) > 0.0
        macros = {**self._macros, "SHADE_PARTS": int(parted)}
        if rays is not None:
            macros["VPL_VISIBILITY"] = 2
        shade = self.runtime.kernel("multires/shade_list.cl", macros, (CAMERA, VPL, CUT, SCENE_RAYS))
        if rays is not None:
            blocks = rays.arguments
        elif occupancy is not None:
            blocks = {**occupancy.arguments, "camera": source.camera_struct}
        else:
            blocks = {}
        batches = [*self.lights.batches()]
        for first in range(0, groups, self._groups):
            here = min(groups - first, self._groups)
            limits = {"first": first, "groups": here, "scale": scale, "faint": FAINT, "bright": BRIGHT}
            for number in range(0, len(batches), self._at_once):
                segments = min(len(batches) - number, self._at_once)
                cut = CUT.pack({**limits, "segments": segments, "lights": self.lights.count})
                shared = {
                    "list": samples,
                    "lists": self._lists,
                    "counts": self._counts,
                    "cut": cut,
                    "params": self._packed({**values, **batches[number]}, source.margin),
                }
                self._cut.run(
                    source.size,
                    grid=(segments, min(here * self._items, items)),
                    local=local or (1, GROUP),
                    depth=source.depth,
                    normal=source.normal,
                    bounds=self._bounds,
                    limits=self.limits,
                    kept=self._kept,
                    camera=source.camera_struct,
                    **shared,
                )
                shade.run(
                    source.size,
                    grid=(1, min(here * pieces, items)),
                    local=local,
                    samples=self._kept,
                    all_records=self._records,
                    lights=self.lights.lights if parted else None,
                    **blocks,
                    fractions=fractions,
                    values=result,
                    **shared,
                )

    def cuts(self, count: int) -> list[NDArray[np.int32]]:
        """Return the records that the first groups of the latest pass listed. Waits for the device."""
        return [row & (CUT_SHARED - 1) for row in self._listed(count)]

    def shared(self, count: int) -> list[NDArray[np.bool_]]:
        """Return of each of these records whether its 64 lights have one shadow ray."""
        return [row & CUT_SHARED != 0 for row in self._listed(count)]

    def bright(self, count: int) -> list[NDArray[np.bool_]]:
        """Return of each of these records whether every 4 of its lights have a shadow ray."""
        return [row & CUT_BRIGHT != 0 for row in self._listed(count)]

    def _listed(self, count: int) -> list[NDArray[np.int32]]:
        counts = self._counts.download()[:count]
        lists = self._lists.download().reshape(-1, self.lights.capacity)
        return [row[:length] for row, length in zip(lists, counts, strict=False)]

    def records(self) -> NDArray[np.float32]:
        """Return [segments, records, RECORD] lights and clusters. Waits for the device."""
        return self._records.download().reshape(self.lights.segments, -1, RECORD)

    def _packed(self, values: dict[str, float], margin: Size) -> Any:
        return packed_params({**self.lights.values, **values}, margin)
