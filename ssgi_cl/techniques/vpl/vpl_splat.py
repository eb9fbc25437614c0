"""Splatting of virtual point lights: one-bounce indirect light at every pixel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Unpack

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.params import Prepared, param, with_fields_described
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Scene
from ssgi_cl.core.vpls import MOST_VPLS, Vpls
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.techniques.bands import banded
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.occupancy.occupancy_grid import Occupancy, OccupancyGrid, check_grid, grid_param
from ssgi_cl.techniques.technique import Bench, Technique
from ssgi_cl.techniques.vpl.packed_vpls import CAPACITY, NEAR_CAPACITY, VPL, DeviceVpls, VplChooser, packed_params
from ssgi_cl.techniques.vpl.tile_boxes import BOX, bound_tiles, tiles_of
from ssgi_cl.techniques.vpl.view_importance import ViewImportance
from ssgi_cl.techniques.vpl.vpl_light import (
    NEARS,
    VplKeywords,
    VplParams,
    camera_of,
    importance_param,
    lights_plan,
    lit_by_maps,
    refine_param,
)

ROWS = 2
"""Rows of pixels of a work-item: each light is read once for all of them."""
ALL, KEPT, LOST = range(3)
"""VPL_CUT in kernels/vpl/light.clh: all light, what the cutoff keeps, and what it leaves out."""
COARSER = 16
"""Lights merged into one for the light that the cutoff leaves out, which is smooth."""


@dataclass(frozen=True, kw_only=True)
class VplSplatParams(VplParams):
    """Parameters of splatting (Dachsbacher and Stamminger 2006)."""

    restore: bool = param(True, "put back what the cutoff leaves out, computed with a sixteenth of the lights")
    refine: float = refine_param("(of which an interleaved pixel takes one); only with `cull`")
    interleave: bool = param(False, "each pixel of 4 x 4 takes one light in 16, and a blur evens them out")
    blur_radius: int = param(4, "of that blur; 0 for none", low=0, high=16, unit="px")
    visibility: bool = param(
        False,
        "surfaces block light on its way from light to pixel: all triangles where `scene` "
        "is given, else what the camera and the lights see; needs `interleave`",
    )
    grid: int = grid_param()
    importance: bool = importance_param()
    share: int = param(16, "lights of a pixel that share a shadow ray", low=1, high=256)
    glossy_vpls: int = param(
        0, "more lights, with Phong lobes, for what glossy surfaces mirror; 0: none", low=0, high=MOST_VPLS
    )
    cull: bool = param(True, "tiles skip the lights that give them nothing (same but for rounding)")

    def __post_init__(self) -> None:
        VplParams.__post_init__(self)
        check_grid(self.grid)
        if self.visibility and not self.interleave:
            raise ValueError("visibility is True: expected interleave=True with it")
        if self.interleave and not self.cull:
            raise ValueError("cull is False: expected True with interleave=True")

    @property
    def parted(self) -> bool:
        """Whether lights may give way to their parts."""
        return self.refine > 0.0 and self.cull


class VplSplatKeywords(VplKeywords, total=False):
    """The other parameters of `vpl_splat`."""

    restore: bool
    interleave: bool
    blur_radius: int
    glossy_vpls: int
    cull: bool


class VplSplat(Prepared[VplSplatParams]):
    """Splatting, prepared for images of one size.

    Keller 1997; Dachsbacher and Stamminger 2006. Departs: see `vpl_splat`.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        params: see `VplSplatParams`.
    """

    name: ClassVar[str] = "vpl splat"
    """Name of the pass that is reported as skipped without light."""

    def __init__(self, runtime: Runtime, size: Size, params: VplSplatParams | None = None) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or VplSplatParams()
        self._irradiance = runtime.plane(3, size)
        subsets = 16 if params.interleave else 1
        listed = CAPACITY if params.parted and not params.interleave else 1
        self._lights = DeviceVpls(runtime, params.vpls, subsets, parts=params.parted, listed=listed)
        self._coarse = DeviceVpls(runtime, -(-params.vpls // COARSER), subsets)
        self._chooser = VplChooser(runtime, (self._lights, self._coarse))
        self._glossy: tuple[DeviceVpls, ...] = ()
        if params.glossy_vpls:
            self._glossy = tuple(
                DeviceVpls(runtime, most, subsets, glossy=True)
                for most in (params.glossy_vpls, -(-params.glossy_vpls // COARSER))
            )
            self._glossy_chooser = VplChooser(runtime, self._glossy)
        self._tiles = tiles_of(size)
        tiles = self._tiles[0] * self._tiles[1]
        lists = tiles * subsets if params.cull else 1
        self._boxes = runtime.empty(tiles * BOX, np.float32)
        capacity = max(lights.capacity for lights in (self._lights, *self._glossy))
        self._lists = runtime.empty(lists * capacity, np.int32)
        self._counts = runtime.empty(lists, np.int32)
        parted = params.interleave and params.parted
        self._near = runtime.empty(tiles * NEAR_CAPACITY if parted else 1, np.int32)
        self._near_counts = runtime.empty(tiles, np.int32)
        self._grid = OccupancyGrid(runtime, params.grid, size) if params.visibility else None
        self._importance = ViewImportance(runtime)
        self._blur: Bilateral | None = None
        if params.interleave:
            self._blur = Bilateral(runtime, size, BilateralParams(radius=params.blur_radius), 3)

    def run(
        self,
        gbuffer: DeviceGBuffer,
        vpls: Vpls | None = None,
        *,
        rsms: Sequence[DeviceRsm] = (),
        glossy: Vpls | None = None,
        scene: DeviceScene | None = None,
    ) -> Plane:
        """Queue the passes; return the plane of irradiance in W/m^2.

        Args:
            gbuffer: what the camera sees; with `visibility`, all its layers and its margin block
                light.
            vpls: at most as many as the parameters say; None to choose them from `rsms` on the
                device, where nothing is done again as long as the maps stay the same.
            rsms: what the lights are chosen from; with `visibility`, what else blocks light.
            scene: with `visibility`, the triangles that block light in place of what is seen.
            glossy: lights with lobes, at most `glossy_vpls`; None to choose them from those `rsms`
                that mirror anything.

        Raises:
            ValueError: the G-buffer has another size, there are too many lights, or neither lights
                nor maps.
        """
        camera, cut = camera_of(gbuffer, self.size), self.params.cutoff > 0.0
        kinds = 2 if self.params.restore and cut else 1
        values = self._begin(gbuffer, camera, vpls, rsms, kinds)
        occupancy = None
        if self._grid is not None:
            tiles = self._tiles[0] * self._tiles[1]
            occupancy = self._grid.fill(gbuffer, rsms, self._boxes, tiles, self._lights, scene)
            if vpls is None and self.params.importance:
                curve = self._chooser.place(rsms, camera, kinds=kinds)
                importance = self._importance.run(gbuffer, curve, occupancy=occupancy)
                self._chooser.place(rsms, camera, kinds=kinds, importance=importance)
        parts = (KEPT if cut else ALL, LOST)[:kinds]
        for part, lights in zip(parts, (self._lights, self._coarse), strict=False):
            self._shine(gbuffer, lights, values, part, occupancy, add=part == LOST)
        if self._glossy and self._place_lobes(camera, glossy, rsms, kinds):
            for part, lights in zip(parts, self._glossy, strict=False):
                own = {**values, **self._cut_values(lights), "refine": 0.0}
                self._shine(gbuffer, lights, own, part, occupancy, add=True)
        if self._blur is None:
            return self._irradiance
        return self._blur.run(gbuffer, self._irradiance)

    def lost(self, gbuffer: DeviceGBuffer, vpls: Vpls) -> float:
        """Return the share of the image's irradiance that the cutoff leaves out, without visibility."""
        if self.params.cutoff == 0.0:
            return 0.0
        values = self._begin(gbuffer, camera_of(gbuffer, self.size), vpls, (), 2)
        sums = []
        for lights, part in ((self._lights, KEPT), (self._coarse, LOST)):
            self._shine(gbuffer, lights, values, part)
            sums.append(float(self._irradiance.download().sum(dtype=np.float64)))
        return sums[1] / sum(sums) if sum(sums) > 0.0 else 0.0

    def lists(self) -> NDArray[np.object_]:
        """Return the lights of the latest batch on the lists of tiles: [rows, columns, subsets] arrays.

        Parts of lights have numbers beyond the batch's.
        """
        counts = self._counts.download().reshape(*self._tiles, -1)
        numbers = self._lists.download().reshape(*counts.shape, -1)
        result = np.empty(counts.shape, np.object_)
        for at in np.ndindex(counts.shape):
            result[at] = numbers[at][: counts[at]] * counts.shape[-1] + at[-1]
        return result

    def _begin(
        self, gbuffer: DeviceGBuffer, camera: Camera, vpls: Vpls | None, rsms: Sequence[DeviceRsm], kinds: int
    ) -> dict[str, float]:
        """Bring the lights to the device or choose them there; return the struct's rest.

        With two `kinds` the coarse ones too. The tiles' bounds are queued.
        """
        params, lights = self.params, self._lights
        if vpls is not None:
            lights.upload(vpls, camera)
            if kinds == 2:
                self._coarse.upload(vpls.merged(self._coarse.most), camera, lights.unit)
        elif rsms:
            self._chooser.place(rsms, camera, kinds=kinds)
        else:
            raise ValueError("vpls is None and there are no maps: expected one of them at least")
        values = {**self._cut_values(lights), "refine": params.refine if lights.parted else 0.0}
        if params.cull:
            bound_tiles(self.runtime, gbuffer, self._boxes, lights)
        return values

    def _place_lobes(self, camera: Camera, glossy: Vpls | None, rsms: Sequence[DeviceRsm], kinds: int) -> bool:
        """Bring lights with lobes to the device or choose them there; return whether there are any."""
        mirroring = [rsm for rsm in rsms if rsm.lobes is not None]
        # Tiles' bounds are in the unit of the diffuse lights.
        unit = self._lights.unit
        if glossy is not None:
            self._glossy[0].upload(glossy, camera, unit)
            self._glossy[1].upload(glossy.merged(self._glossy[1].most), camera, unit)
        elif mirroring:
            self._glossy_chooser.place(mirroring, camera, kinds=kinds, unit=unit)
        else:
            self.runtime.skip("vpl lobes", "nothing mirrors light")
            return False
        return True

    def _cut_values(self, lights: DeviceVpls) -> dict[str, float]:
        """Return the members of the struct that say where light of a kind counts."""
        cutoff = self.params.scaled_cutoff(lights.unit)
        # Where cos / (pi d^2) of a diffuse light exceeds the cutoff: within a sphere.
        reach = 1.0 / math.sqrt(math.pi * cutoff) if cutoff > 0.0 else 0.0
        return {
            "cutoff": cutoff,
            "lobe_centre": 3.0**-0.75 * reach,
            "lobe_squared": math.sqrt(4.0 / 27.0) * reach * reach * (1.0 + 1e-4),
        }

    def _shine(
        self,
        gbuffer: DeviceGBuffer,
        lights: DeviceVpls,
        values: dict[str, float],
        part: int,
        occupancy: Occupancy | None = None,
        *,
        add: bool = False,
    ) -> None:
        """Queue the passes that make the irradiance of the lights, or add theirs to it."""
        params, structs = self.params, (CAMERA, VPL)
        rows, columns = self._tiles
        parted = lights.parted
        for batch in lights.batches():
            packed = packed_params({**values, **lights.values, **batch}, gbuffer.margin)
            if params.cull:
                macros = {
                    "VPL_CUT": int(part == KEPT),
                    "VPL_SUBSETS": lights.subsets,
                    "VPL_PARTS": int(parted and not params.interleave),
                    "VPL_GLOSSY": int(lights.glossy),
                }
                self.runtime.kernel("vpl/vpl_lists.cl", macros, structs).run(
                    self.size,
                    grid=(rows, columns * lights.subsets),
                    boxes=self._boxes,
                    lights=lights.bounds,
                    lists=self._lists,
                    counts=self._counts,
                    params=packed,
                )
            macros = {
                "VPL_NEAR": NEARS.index(params.near),
                "VPL_CUT": part,
                "VPL_ADD": int(add),
                "VPL_GLOSSY": int(lights.glossy),
            }
            given: dict[str, Any] = {
                "depth": gbuffer.depth,
                "normal": gbuffer.normal,
                "lights": lights.lights,
                "lists": self._lists,
                "counts": self._counts,
                "irradiance": self._irradiance,
                "camera": gbuffer.camera_struct,
                "params": packed,
            }
            if params.interleave:
                if parted:
                    self.runtime.kernel("vpl/vpl_near.cl", structs=(CAMERA, VPL)).run(
                        self.size,
                        grid=(rows, columns),
                        boxes=self._boxes,
                        lights=lights.bounds,
                        near=self._near,
                        counts=self._near_counts,
                        params=packed,
                    )
                macros["VPL_PARTS"] = int(parted)
                self._interleaved(given, macros, occupancy)
            else:
                macros |= {"VPL_LISTS": int(params.cull), "VPL_PARTS": int(parted), "VPL_ROWS": ROWS}
                self.runtime.kernel("vpl/vpl_splat.cl", macros, structs).run(
                    self.size, grid=(-(-self.size[0] // ROWS), -(-self.size[1] // self.runtime.variant.lanes)), **given
                )
            add = True

    def _interleaved(self, given: dict[str, Any], macros: dict[str, int], occupancy: Occupancy | None) -> None:
        macros |= occupancy.macros if occupancy else {"OCCUPANCY_CELLS": 32}
        macros |= {"VPL_VISIBILITY": int(occupancy is not None), "VPL_SHARE": self.params.share}
        pieces = 16 * (16 // self.runtime.variant.lanes)
        self.runtime.kernel("vpl/vpl_interleaved.cl", macros, (CAMERA, VPL)).run(
            self.size,
            grid=(self._tiles[0], self._tiles[1] * pieces),
            occupancy=occupancy.grid if occupancy else None,
            grid_box=occupancy.box if occupancy else None,
            near=self._near,
            near_counts=self._near_counts,
            **given,
        )


@banded(lights_plan)
@with_fields_described(VplSplatParams)
@serialised
def vpl_splat(
    gbuffer: GBuffer | DeviceGBuffer,
    rsms: ReflectiveShadowMap | DeviceRsm | Sequence[ReflectiveShadowMap | DeviceRsm],
    vpls: int = 1024,
    cutoff: float = 0.01,
    *,
    scene: Scene | None = None,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[VplSplatKeywords],
) -> NDArray[np.float32]:
    """Compute irradiance by one diffuse bounce, from virtual point lights.

    Keller 1997, "Instant Radiosity"; Dachsbacher and Stamminger 2006, "Splatting Indirect
    Illumination". Departs: a light is a disc (form factor of Nichols, Shopf and Wyman 2009), chosen
    along a Hilbert curve through the map; the cutoff fades and what it leaves out is restored;
    near lights give way to their parts; tiles cull lights in place of splats; surfaces may block
    light.

    Args:
        gbuffer: what the camera sees.
        rsms: a reflective shadow map, or one for each light.
        vpls: virtual point lights in all, 1 to 2^24; see `choose_vpls`.
        cutoff: >= 0, see `VplSplatParams`; with 0 every light reaches every pixel.
        scene: with `visibility`, the triangles that block light, seen or not; by default what the
            G-buffer and the maps show does.
        max_memory: as of `gtao`; lights are then chosen without `importance`, and `visibility` needs `scene`.
        runtime: the device; by default the fastest found.
        **params: the other fields of `VplSplatParams`.

    Returns:
        E [rows, columns, 3] float32 in W/m^2, at most 1e30; 0 where nothing is.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range; the message says
            which, its value and what is allowed.
    """
    chosen = VplSplatParams(vpls=vpls, cutoff=cutoff, **params)
    return lit_by_maps(VplSplat, chosen, gbuffer, rsms, runtime, scene)


DESCRIPTOR = Technique(
    name="vpl_splat",
    kind="indirect",
    paper="Keller 1997; Dachsbacher and Stamminger 2006",
    function=vpl_splat,
    params=VplSplatParams,
    technique=VplSplat,
    reference="ssgi_cl.reference.vpl.vpl_splat",
    reads=("depth", "normal", "rsms", "scene"),
    writes=("irradiance",),
    quantity="bounce",
    bench=Bench(
        families=("vpl", "vpl-plain", "vpl-interleaved", "vpl-visibility"),
        rows={
            "vpl_splat": (
                "one-bounce indirect light from virtual point lights, diffuse and glossy",
                (
                    ("1024 lights", "vpl.1024"),
                    ("interleaved", "vpl-interleaved.1024"),
                    ("with visibility", "vpl-visibility.1024"),
                ),
            )
        },
    ),
)
