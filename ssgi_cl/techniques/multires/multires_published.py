"""Multiresolution splatting as published: subsplats from a min-max mipmap of depth and normals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.params import Params, Prepared, param
from ssgi_cl.core.vpls import MOST_VPLS, Vpls
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.constants import SUBSPLAT_EMPTY, SUBSPLAT_IMAGES
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.rsm import DeviceRsm
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, Struct, floats
from ssgi_cl.techniques.multires.multires_grid import TILE, Level
from ssgi_cl.techniques.vpl.packed_vpls import VPL, DeviceVpls, VplChooser, packed_params
from ssgi_cl.techniques.vpl.vpl_light import NoLight, camera_of
from ssgi_cl.techniques.vpl.vpl_tree import CPU_ITEMS

SUBSPLAT = Struct("SubsplatParams", floats("depth", "normal", "coarser_depth", "coarser_normal"))
IMAGES, EMPTY = SUBSPLAT_IMAGES, SUBSPLAT_EMPTY
ROWS = 4
"""Times so many subsplats as a work-item has lanes: each light is read once for all of them."""


@dataclass(frozen=True, kw_only=True)
class MultiresPublishedParams(Params):
    """Parameters of multiresolution splatting as published (Nichols and Wyman 2009).

    Defaults are those of the authors' program for "GPU Pro" (2010), where the depth threshold is
    0.1 over a far plane at 16 scene units.
    """

    vpls: int = param(1024, "virtual point lights in all", low=1, high=MOST_VPLS)
    levels: int = param(
        7, "levels of the mipmap; a texel of the coarsest has 2^(levels - 1) pixels along its side", low=1, high=10
    )
    depth_threshold: float = param(
        0.1 / 16.0,
        "depth variation over 3 x 3 pixels, relative to depth (orthographic: to the view's height), "
        "above which a texel of level 3 is refined; at level l it is 3 / l of that",
        low=0.0,
        high=1e6,
    )
    normal_threshold: float = param(
        0.1, "extent of the normals' x or y in view space above which a texel is refined", low=0.0, high=2.0
    )

    def depth_limit(self, level: int) -> float:
        """Return the depth variation above which a texel of a level is refined."""
        return self.depth_threshold * 3.0 / level if level else math.inf

    def normal_limit(self, level: int) -> float:
        """Return the extent of normals above which a texel of a level is refined."""
        return self.normal_threshold if level else math.inf


class MultiresPublished(Prepared[MultiresPublishedParams]):
    """Multiresolution splatting as published, prepared for images of one size.

    Nichols and Wyman 2009, "Multiresolution Splatting for Indirect Illumination" (I3D), with the
    refinement of all levels at once and the form factor of Nichols, Shopf and Wyman 2009 (EGSR).
    Departs: lights are chosen in proportion to flux, and a light's disc has the area that it stands
    for, as in `vpl_splat`, so that both differ by the subsplats alone; subsplats are listed, not
    stencilled.

    Args:
        runtime: the device.
        size: (rows, columns) of the result.
        params: see `MultiresPublishedParams`.
    """

    name: ClassVar[str] = "multires published"
    """Name of the pass that is reported as skipped without light."""

    def __init__(self, runtime: Runtime, size: Size, params: MultiresPublishedParams | None = None) -> None:
        self.runtime = runtime
        self.size = size
        self._params = params = params or MultiresPublishedParams()
        self._lights = DeviceVpls(runtime, params.vpls)
        self._chooser = VplChooser(runtime, (self._lights,))
        sizes = [(-(-size[0] // step), -(-size[1] // step)) for step in (1 << level for level in range(params.levels))]
        self._levels = [Level(runtime, n, 1 << n, own, 3) for n, own in enumerate(sizes)]
        self._variation = [runtime.plane(IMAGES, own, EMPTY) for own in sizes]
        # The light of a level and all coarser ones; that of the coarsest is its own.
        self._merged = [(runtime.plane(3, own), runtime.plane(1, own)) for own in sizes[:-1]]
        self._no_light = NoLight(runtime, size, self.name)
        self._vary = runtime.kernel("multires/subsplat_variation.cl", structs=(CAMERA,))
        self._mip = runtime.kernel("multires/subsplat_mip.cl")
        self._refine = runtime.kernel("multires/subsplat_refine.cl", structs=(SUBSPLAT,))
        self._shade = runtime.kernel(
            "multires/subsplat_shade.cl", {"VPL_NEAR": 0, "VPL_CUT": 0, "SUBSPLAT_ROWS": ROWS}, (CAMERA, VPL)
        )
        self._upsample = runtime.kernel("multires/subsplat_upsample.cl")

    def run(self, gbuffer: DeviceGBuffer, vpls: Vpls | None = None, *, rsms: Sequence[DeviceRsm] = ()) -> Plane:
        """Queue the passes; return the plane of irradiance, 3 images in W/m^2.

        Args:
            gbuffer: what the camera sees; its front layer alone counts, and not its margin.
            vpls, rsms: see `VplSplat.run`.

        Raises:
            ValueError: the G-buffer is empty or has another size, or there are too many lights.
        """
        camera = camera_of(gbuffer, self.size)
        if not (rsms if vpls is None else vpls):
            return self._no_light.skipped()
        self._find_subsplats(gbuffer)  # the device has work while the host packs the lights
        if vpls is None:
            self._chooser.place(rsms, camera, kinds=1)
        else:
            self._lights.upload(vpls, camera)
        for level in self._levels:
            self._light(gbuffer, level)
        return self._combine()

    def counts(self) -> list[int]:
        """Return the number of subsplats of each level, from the finest on. Waits for the device."""
        return [int(level.list.download()[0]) for level in self._levels]

    def computed(self) -> NDArray[np.int32]:
        """Return [rows, columns] the side of the subsplat that a pixel lies in, 0: none.

        Waits for the device.
        """
        steps = np.zeros(self.size, np.int32)
        for level in self._levels:
            kept = level.fractions.download()[0] > 0.0
            wide = kept.repeat(level.step, axis=0).repeat(level.step, axis=1)
            steps[wide[: self.size[0], : self.size[1]]] = level.step
        return steps

    def _find_subsplats(self, gbuffer: DeviceGBuffer) -> None:
        """Queue the passes that make the mipmap and the lists of subsplats of all levels."""
        params, levels, variation = self.params, self._levels, self._variation
        self._vary.run(
            self.size,
            depth=gbuffer.depth,
            normal=gbuffer.normal,
            variation=variation[0],
            whole=gbuffer.whole,
            margin=gbuffer.margin,
            camera=gbuffer.camera_struct,
        )
        for finer, coarser in pairwise(variation):
            self._mip.run(coarser.size, finer=finer, coarser=coarser, finer_size=finer.size)
        for n, level in enumerate(levels):
            # There is nothing above the coarsest level: no limit that a parent could keep.
            above = n + 1 < len(levels)
            coarser = variation[n + 1 if above else n]
            limits = {
                "depth": params.depth_limit(n),
                "normal": params.normal_limit(n),
                "coarser_depth": params.depth_limit(n + 1) if above else -math.inf,
                "coarser_normal": params.normal_limit(n + 1) if above else -math.inf,
            }
            level.mark(
                self._refine,
                (level.size[0], -(-level.size[1] // TILE)),
                variation=variation[n],
                coarser=coarser,
                coarser_size=coarser.size,
                limits=SUBSPLAT.pack(limits),
            )

    def _light(self, gbuffer: DeviceGBuffer, level: Level) -> None:
        """Queue the passes that add the irradiance of all lights to a level's subsplats."""
        lanes, is_gpu = self.runtime.variant.lanes, self.runtime.info.kind == "gpu"
        items = 1 << 30 if is_gpu else CPU_ITEMS * self.runtime.device.max_compute_units
        pieces = -(-level.most // (lanes * ROWS))
        for batch in self._lights.batches():
            self._shade.run(
                level.size,
                grid=(1, min(pieces, items)),
                local=self.runtime.small_groups(1),
                depth=gbuffer.depth,
                normal=gbuffer.normal,
                list=level.list,
                lights=self._lights.lights,
                values=level.values,
                camera=gbuffer.camera_struct,
                params=packed_params({**self._lights.values, **batch}, gbuffer.margin),
                image=self.size,
                step=level.step,
            )

    def _combine(self) -> Plane:
        """Queue the passes that interpolate from the coarsest level down to the pixels."""
        coarsest = self._levels[-1]
        values, fractions = coarsest.values, coarsest.fractions
        finer = zip(self._levels[-2::-1], self._merged[::-1], strict=True)
        for level, (merged, merged_fractions) in finer:
            self._upsample.run(
                level.size,
                coarse_values=values,
                coarse_fractions=fractions,
                fine_values=level.values,
                fine_fractions=level.fractions,
                values=merged,
                fractions=merged_fractions,
                coarse_size=values.size,
            )
            values, fractions = merged, merged_fractions
        return values
