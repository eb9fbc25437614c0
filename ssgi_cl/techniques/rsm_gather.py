"""One bounce of light gathered from a reflective shadow map, without indirect visibility."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.camera import Camera
from ssgi_cl.device_gbuffer import DeviceGBuffer, on_device
from ssgi_cl.device_rsm import DeviceRsm, on_device_rsm
from ssgi_cl.gbuffer import GBuffer, ReflectiveShadowMap
from ssgi_cl.kernel import Kernel
from ssgi_cl.memory import Plane, Size
from ssgi_cl.params import Params, param
from ssgi_cl.runtime import Runtime
from ssgi_cl.structs import (
    CAMERA,
    ROTATION,
    Struct,
    camera_values,
    floats,
    rotation_values,
)
from ssgi_cl.techniques.multires_grid import Level, MultiresGrid, MultiresGridParams
from ssgi_cl.techniques.rsm_samples import (
    FluxSamples,
    TexelRecords,
    cap_pattern,
    cube_turns,
    disk_pattern,
    tile_turns,
)

RESOLUTIONS = ("full", "adaptive")

GATHER = Struct(
    "RsmGatherParams",
    (
        *floats(*ROTATION, "x", "y", "z"),
        *((name, "int") for name in ("margin_columns", "margin_rows", "samples")),
    ),
)
MAP = Struct(
    "RsmMapParams",
    (*floats(*ROTATION, "radius", "density"), ("columns", "int"), ("rows", "int")),
)
@dataclass(frozen=True, kw_only=True)
class RsmGatherParams(Params):
    """Parameters of gathering from a reflective shadow map (Dachsbacher and Stamminger 2005).

    In the time of 400 samples in a disk, which lie scattered in memory, 6400 drawn by flux have
    0.33 to 0.66 of the error (against all texels; Cornell box and both lamps of the hall). A disk
    as far as the furthest corner has at most 12 % more error there than the best of 0.25, 0.5,
    0.75, 1 and 1.42 sides, which is 0.75 for one lamp and 1 for the others.
    """

    samples: int = param(400, "texels that a pixel gathers from", low=1, high=65536)
    pattern: str = param(
        "flux", "'flux': drawn in proportion to flux, the same for all pixels; 'fixed': a disk "
        "round the pixel's place in the map; 'rotated': the disk turned from pixel to pixel, noise "
        "for bands; 'all': every texel, whatever `samples` is",
        choices=("flux", "fixed", "rotated", "all"),
    )
    radius: float = param(
        math.inf, "of the disk; by default as far as the furthest corner of the map",
        unit="sides of a face of the map", low=0.0, above=True, high=math.inf,
    )
    weights: str = param(
        "unbiased", "of samples in the disk: what their density lacks, or as in the paper, which "
        "does not converge to the sum over all texels", choices=("unbiased", "paper"),
    )
    resolution: str = param(
        "full", "'full': light is gathered for all pixels; 'adaptive': for those alone between "
        "which it is not smooth, the others are interpolated", choices=RESOLUTIONS,
    )
    error: float = param(
        0.02, "of interpolation, as estimated", unit="of the mean irradiance", low=0.0, high=1e6
    )
    plane_tolerance: float = param(
        0.005, "distance from the tangent plane at which a neighbour counts nothing",
        unit="depths", low=1e-6, high=1.0,
    )
    normal_tolerance: float = param(
        0.32, "angle between normals at which it counts nothing", unit="radians", low=1e-3, high=3.0
    )


class RsmGather:
    """Gathering, prepared for images of one size.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        params: see `RsmGatherParams`.
        margin: (rows, columns) by which the G-buffers exceed the result on every side.
    """

    name: ClassVar[str] = "rsm gather"
    """Of the pass that is skipped where no light is."""

    def __init__(
        self,
        runtime: Runtime,
        size: Size,
        params: RsmGatherParams | None = None,
        margin: Size = (0, 0),
    ) -> None:
        self.params = params = params or RsmGatherParams()
        self.runtime = runtime
        self.size = size
        self.margin = margin
        self._texels: TexelRecords | None = None
        self._picked: FluxSamples | None = None
        self._current: tuple[DeviceRsm, int] | None = None
        # Without a list kernels get one and shares that they don't read.
        self._no_list = runtime.empty(1, np.int32)
        self._no_shares = runtime.plane(1, (1, 1))
        self._grid: MultiresGrid | None = None
        if params.resolution == "adaptive":
            self._grid = MultiresGrid(
                runtime, size,
                MultiresGridParams(
                    plane_tolerance=params.plane_tolerance, normal_tolerance=params.normal_tolerance
                ),
            )
            self._bound = runtime.empty(1, np.float32)
            self._bounds = runtime.kernel("rsm_gather/rsm_gather_bound.cl")
        else:
            self._irradiance = runtime.plane(3, size)
        if params.pattern in ("fixed", "rotated"):
            self._pattern = runtime.empty(4 * params.samples, np.float32)
            self._is_cap: bool | None = None
            turn = tile_turns()
            table = np.stack([np.cos(turn), np.sin(turn)], axis=1)  # row, function, column
            self._turns = runtime.array(table.astype(np.float32))

    @property
    def computed(self) -> float:
        """Share of all pixels that the latest run gathered for. Waits for the device."""
        if self._grid is None:
            return 1.0
        return sum(self._grid.counts().values()) / (self.size[0] * self.size[1])

    def run(self, gbuffer: DeviceGBuffer, rsm: DeviceRsm) -> Plane:
        """Queue the passes; return the plane of irradiance, 3 images in W/m^2.

        Nothing is allocated after the first call with maps of one size, and what depends on the
        map alone is made when it changes.

        Raises:
            ValueError: a G-buffer of another size or margin, an empty one, or a map whose faces do
                not suit the pattern.
        """
        if (gbuffer.size, gbuffer.margin) != (self.size, self.margin):
            raise ValueError(
                f"the G-buffer's size and margin are {gbuffer.size} and {gbuffer.margin}: "
                f"expected {self.size} and {self.margin}"
            )
        if gbuffer.camera is None:
            raise ValueError("the device G-buffer is empty: draw or upload something first")
        self._prepare(rsm)
        if self._grid is None:
            self._gather(gbuffer, gbuffer.camera, rsm, self._irradiance)
            return self._irradiance
        for level in self._grid.levels(gbuffer, self._bound):
            self._gather(level.source, gbuffer.camera, rsm, level.values, level)
            if level.number == 0:
                self._bounds.run(
                    "mean", level.size, [level.list], [level.values, self._bound],
                    [np.float32(self.params.error)], grid=(1, 1), local=(1, 1),
                )
        return self._grid.result

    def __call__(
        self,
        gbuffer: GBuffer | DeviceGBuffer,
        rsm: ReflectiveShadowMap | DeviceRsm,
        out: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Return irradiance [rows, columns, 3] float32 in W/m^2, written to `out` if given."""
        device, light = on_device(gbuffer, self.runtime), on_device_rsm(rsm, self.runtime)
        if out is None:
            out = np.empty((*self.size, 3), np.float32)
        with self.runtime.frame():
            self.run(device, light).download(np.moveaxis(out, -1, 0))
        return out

    def _prepare(self, rsm: DeviceRsm) -> None:
        """Queue what makes the samples of the map, unless they are those of last time."""
        if self.params.pattern in ("fixed", "rotated"):
            self._check_faces(rsm)
            self._set_pattern(cap=rsm.faces == 6)
        if self._texels is None or self._texels.size != rsm.size:
            self._texels = TexelRecords(self.runtime, rsm.size)
            self._current = None
            if self.params.pattern == "flux":
                self._picked = FluxSamples(self.runtime, self._texels, self.params.samples)
        before, self._current = self._current, (rsm, rsm.version)
        if before is not None and before[0] is rsm and before[1] == rsm.version:
            return
        self._texels.update(rsm)
        if self._picked is not None:
            self._picked.update()

    def _set_pattern(self, *, cap: bool) -> None:
        params = self.params
        if self._is_cap is cap:
            return
        self._is_cap = cap
        values = (
            cap_pattern(params.samples, params.weights, min(0.5 * math.pi * params.radius, math.pi))
            if cap
            else disk_pattern(params.samples, params.weights)
        )
        self._pattern.upload(values.astype(np.float32))

    def _gather(
        self, source: Any, camera: Camera, rsm: DeviceRsm, result: Plane,
        level: Level | None = None,
    ) -> None:
        """Queue the gathering for all pixels of `source`, or for those of the level's list."""
        kernel, reads, values, samples = self._road(rsm, listed=level is not None)
        to_map = rsm.from_view(camera)
        packed = GATHER.pack(
            {
                **rotation_values(to_map[:, :3]),
                **dict(zip("xyz", to_map[:, 3], strict=True)),
                "margin_columns": source.margin[1],
                "margin_rows": source.margin[0],
                "samples": samples,
            }
        )
        grid = local = None
        if level is not None:
            # Each work-item takes every so-many-th piece of the list, whose length the host does
            # not know; a GPU has enough of them for one piece each.
            pieces = -(-result.size[0] * result.size[1] // self.runtime.form.lanes)
            is_gpu = self.runtime.info.kind == "gpu"
            grid, local = (1, pieces if is_gpu else min(pieces, 1024)), (1, 64 if is_gpu else 1)
        listed = self._no_list if level is None else level.list
        shares = self._no_shares if level is None else level.shares
        kernel.run(
            "rsm gather" if level is None else f"rsm gather {level.step}", result.size,
            reads=[source.depth, source.normal, listed, *reads, shares],
            writes=[result], values=[source.camera_struct, packed, *values], grid=grid, local=local,
        )

    def _road(self, rsm: DeviceRsm, *, listed: bool) -> tuple[Kernel, list[Any], list[Any], int]:
        """Return the kernel, its further arguments and the number of samples."""
        params, texels = self.params, self._texels
        assert texels is not None  # noqa: S101  _prepare made them
        macros = {"RSM_GATHER_LISTED": int(listed)}
        if params.pattern in ("flux", "all"):
            samples = self._picked or texels
            kernel = self.runtime.kernel(
                "rsm_gather/rsm_gather_same.cl", macros, (CAMERA, GATHER)
            )
            return kernel, [samples.records], [], samples.count
        kernel = self.runtime.kernel(
            "rsm_gather/rsm_gather_disk.cl",
            {
                **macros,
                "RSM_GATHER_ROTATED": int(params.pattern == "rotated"),
                "RSM_GATHER_SPHERE": int(rsm.faces == 6),
            },
            (CAMERA, GATHER, MAP),
        )
        camera = rsm.cameras[0]
        light = camera_values(camera)
        rows, columns = rsm.face_size
        values = {
            **rotation_values(camera.view[:3, :3]),
            "radius": params.radius * max(rows, columns) if math.isfinite(params.radius) else 0.0,
            "density": 1.0 / abs(light["to_x"] * light["to_y"]),
            "columns": columns,
            "rows": rows,
        }
        reads = [texels.records, self._pattern, self._turns]
        return kernel, reads, [CAMERA.pack(light), MAP.pack(values)], params.samples

    def _check_faces(self, rsm: DeviceRsm) -> None:
        if rsm.faces == 1:
            return
        turns = [camera.view[:3, :3] for camera in rsm.cameras]
        if rsm.faces != 6 or not np.allclose(turns, cube_turns(), atol=1e-6):
            raise ValueError(
                f"the reflective shadow map has {rsm.faces} faces: expected one, or the six of "
                "rasterize.rsm (+x, -x, +y, -y, +z, -z) for the patterns 'fixed' and 'rotated'"
            )


def rsm_gather(
    gbuffer: GBuffer | DeviceGBuffer,
    rsm: ReflectiveShadowMap | DeviceRsm,
    samples: int = 400,
    *,
    radius: float | None = None,
    weights: str = "unbiased",
    pattern: str = "flux",
    resolution: str = "full",
    runtime: Runtime | None = None,
    **params: Any,
) -> NDArray[np.float32]:
    """Compute irradiance by light that the surfaces in a reflective shadow map reflect once.

    E(x) = sum over texels of flux cos cos / (pi d^2 + area) (Dachsbacher and Stamminger 2005, eq.
    1, each texel a disc of the surface that it stands for); walls between texel and pixel cast no
    shadow, and what glossy surfaces mirror is left out (`vpl_splat` has both).

    Args:
        gbuffer: depth, and normals if there are any.
        rsm: what `rasterize.rsm` returns.
        samples: texels that each pixel gathers from, 1 to 65536.
        radius: of the disk of "fixed" and "rotated" in sides of the map (of a point light's face),
            > 0; by default as far as the furthest corner of the map, so that nothing is left out.
        weights: "unbiased", or "paper" for those of the paper.
        pattern: "flux", "fixed", "rotated" or "all"; see `RsmGatherParams`.
        resolution: "full", or "adaptive" for fewer pixels where light is smooth.
        runtime: the device; by default the fastest found.
        **params: the other fields of `RsmGatherParams`.

    Returns:
        Irradiance E [rows, columns, 3] float32 in W/m^2, not clamped to 1; 0 where nothing is.

    Raises:
        TypeError, ValueError: a parameter of the wrong type or out of range; the message says
            which, its value and what is allowed.
    """
    chosen = RsmGatherParams(
        samples=samples, radius=math.inf if radius is None else radius, weights=weights,
        pattern=pattern, resolution=resolution, **params,
    )
    device = on_device(gbuffer, runtime)
    runtime = device.runtime
    technique: RsmGather = runtime.prepared(
        (RsmGather, device.size, device.margin, chosen),
        lambda: RsmGather(runtime, device.size, chosen, device.margin),
    )
    return technique(device, rsm)
