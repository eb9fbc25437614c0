"""Gathering light from reflective shadow maps: samples of each map, and the passes over them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.arrays import DeviceArray, Plane, Size
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, camera_values, floats, ints, rotation_values
from ssgi_cl.techniques.multires.multires_grid import Level
from ssgi_cl.techniques.rsm.rsm_samples import (
    FluxSamples,
    TexelRecords,
    cap_pattern,
    cube_turns,
    disk_pattern,
    tile_turns,
)
from ssgi_cl.techniques.source import Source, margin_values

GATHER = Struct(
    "RsmGatherParams", (*floats(*ROTATION, "x", "y", "z"), *ints("margin_columns", "margin_rows", "samples", "add"))
)
MAP = Struct("RsmMapParams", (*floats(*ROTATION, "radius", "density", "offset"), ("columns", "int"), ("rows", "int")))


@dataclass(frozen=True, kw_only=True)
class MapSampling:
    """Sampling of the texels of a map.

    Attributes:
        pattern: "flux", "fixed", "rotated" or "all"; see `RsmGatherParams`.
        samples: of each map, unless the pattern is "all".
        radius: of the disk in sides of a face of the map; inf: to the furthest corner.
        weights: of samples in a disk, see `disk_pattern`.
        offset: None: texels are discs. Else they are points, moved by that many widths of the
            texel's surface along minus its normal; with "fixed" and "rotated" alone.
    """

    pattern: str
    samples: int
    radius: float = math.inf
    weights: str = "unbiased"
    offset: float | None = None


class _Samples:
    """Samples of one map, updated when the map changes."""

    def __init__(self, runtime: Runtime, size: Size, sampling: MapSampling) -> None:
        self.texels = TexelRecords(runtime, size)
        self.picked: FluxSamples | None = None
        if sampling.pattern == "flux":
            self.picked = FluxSamples(runtime, self.texels, sampling.samples)
        self._current: tuple[DeviceRsm, int] | None = None

    def update(self, rsm: DeviceRsm) -> None:
        before, self._current = self._current, (rsm, rsm.version)
        if before is not None and before[0] is rsm and before[1] == rsm.version:
            return
        self.texels.update(rsm)
        if self.picked is not None:
            self.picked.update()


class RsmMaps:
    """Gathering from maps; samples are updated when the maps change."""

    def __init__(self, runtime: Runtime, sampling: MapSampling) -> None:
        self.runtime = runtime
        self.sampling = sampling
        self._maps: list[tuple[DeviceRsm, _Samples]] = []
        self._kept: list[_Samples] = []
        self._in_disk = sampling.pattern in ("fixed", "rotated")
        self._patterns: dict[bool, DeviceArray] = {}
        if self._in_disk:
            turn = tile_turns()
            table = np.stack([np.cos(turn), np.sin(turn)], axis=1)  # row, function, column
            self._turns = runtime.array(table.astype(np.float32))

    def set(self, sampling: MapSampling) -> None:
        """Replace the sampling by one of the same pattern, number and weights."""
        if sampling.radius != self.sampling.radius and True in self._patterns:
            self._patterns[True].upload(_pattern(sampling, cap=True))
        self.sampling = sampling

    def prepare(self, rsms: Sequence[DeviceRsm]) -> None:
        """Queue the passes that make the samples of the maps, unless they are those of last time.

        Raises:
            ValueError: a map's faces do not suit the pattern.
        """
        if self._in_disk:
            for rsm in rsms:
                _check_faces(rsm)
                cap = rsm.faces == 6
                if cap not in self._patterns:
                    self._patterns[cap] = self.runtime.array(_pattern(self.sampling, cap=cap))
        for number, rsm in enumerate(rsms):
            if number == len(self._kept):
                self._kept.append(_Samples(self.runtime, rsm.size, self.sampling))
            elif self._kept[number].texels.size != rsm.size:
                self._kept[number] = _Samples(self.runtime, rsm.size, self.sampling)
            self._kept[number].update(rsm)
        self._maps = list(zip(rsms, self._kept, strict=False))

    def gather(self, source: Source, camera: Camera, result: Plane, level: Level | None = None) -> None:
        """Queue the gathering from all maps that were prepared, at least one.

        Args:
            source: the G-buffer, or a level's points.
            camera: of the G-buffer.
            result: 3 images, W/m^2.
            level: whose list of pixels gets its share of the light added; by default all pixels of
                `source` get it.
        """
        grid = local = None
        if level is not None:
            # Each work-item takes every so-many-th piece of the list, whose length the host does
            # not know; a GPU has enough of them for one piece each.
            pieces = -(-result.size[0] * result.size[1] // self.runtime.variant.lanes)
            is_gpu = self.runtime.info.kind == "gpu"
            grid, local = (1, pieces if is_gpu else min(pieces, 1024)), self.runtime.small_groups(1)
        for number, (rsm, samples) in enumerate(self._maps):
            kernel, given, count = self._pass(rsm, samples, listed=level is not None)
            to_map = rsm.from_view(camera)
            values = {
                **rotation_values(to_map[:, :3]),
                **dict(zip("xyz", to_map[:, 3], strict=True)),
                **margin_values(source.margin),
                "samples": count,
                "add": int(number > 0),
            }
            kernel.run(
                result.size,
                grid=grid,
                local=local,
                depth=source.depth,
                normal=source.normal,
                list=None if level is None else level.list,
                fractions=None if level is None else level.fractions,
                irradiance=result,
                camera=source.camera_struct,
                params=GATHER.pack(values),
                **given,
            )

    def _pass(self, rsm: DeviceRsm, samples: _Samples, *, listed: bool) -> tuple[Kernel, dict[str, Any], int]:
        """Return the kernel, its further arguments and the number of samples."""
        sampling = self.sampling
        macros = {"RSM_GATHER_LISTED": int(listed)}
        if not self._in_disk:
            chosen = samples.picked or samples.texels
            kernel = self.runtime.kernel("rsm/rsm_gather_same.cl", macros, (CAMERA, GATHER))
            return kernel, {"samples": chosen.records}, chosen.count
        kernel = self.runtime.kernel(
            "rsm/rsm_gather_disk.cl",
            {
                **macros,
                "RSM_GATHER_ROTATED": int(sampling.pattern == "rotated"),
                "RSM_GATHER_SPHERE": int(rsm.faces == 6),
                "RSM_GATHER_POINTS": int(sampling.offset is not None),
            },
            (CAMERA, GATHER, MAP),
        )
        camera = rsm.cameras[0]
        light = camera_values(camera)
        rows, columns = rsm.face_size
        values = {
            **rotation_values(camera.view[:3, :3]),
            "radius": sampling.radius * max(rows, columns) if math.isfinite(sampling.radius) else 0.0,
            "density": 1.0 / abs(light["to_x"] * light["to_y"]),
            "offset": sampling.offset or 0.0,
            "columns": columns,
            "rows": rows,
        }
        given = {
            "texels": samples.texels.records,
            "pattern": self._patterns[rsm.faces == 6],
            "turns": self._turns if sampling.pattern == "rotated" else None,
            "map": CAMERA.pack(light),
            "light": MAP.pack(values),
        }
        return kernel, given, sampling.samples


def _pattern(sampling: MapSampling, *, cap: bool) -> NDArray[np.float32]:
    """Return the pattern for maps of one face, or of six, as kernels read it."""
    count, weights = sampling.samples, sampling.weights
    if cap:
        values = cap_pattern(count, weights, min(0.5 * math.pi * sampling.radius, math.pi))
    else:
        values = disk_pattern(count, weights)
    return values.astype(np.float32)


def _check_faces(rsm: DeviceRsm) -> None:
    if rsm.faces == 1:
        return
    turns = [camera.view[:3, :3] for camera in rsm.cameras]
    if rsm.faces != 6 or not np.allclose(turns, cube_turns(), atol=1e-6):
        raise ValueError(
            f"the reflective shadow map has {rsm.faces} faces: expected one, or the six of "
            "rasterize.rsm (+x, -x, +y, -y, +z, -z) for samples in a disk"
        )
