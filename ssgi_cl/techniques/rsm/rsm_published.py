"""Gathering from reflective shadow maps as published: a disk of samples, mostly interpolated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.params import Params, param
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.structs import CAMERA, Struct, floats, ints
from ssgi_cl.techniques.multires.multires_grid import TILE, Level
from ssgi_cl.techniques.rsm.rsm_maps import MapSampling
from ssgi_cl.techniques.rsm.rsm_technique import RsmTechnique
from ssgi_cl.techniques.source import margin_values

INTERPOLATE = Struct(
    "RsmInterpolateParams", (*floats("reach", "cosine"), *ints("margin_columns", "margin_rows", "step"))
)


@dataclass(frozen=True, kw_only=True)
class RsmPublishedParams(Params):
    """Parameters of gathering as published (Dachsbacher and Stamminger 2005, sections 4.1, 4.2).

    The paper gives numbers for the samples and for the low-resolution pass alone (32 x 32 or 64 x
    64 pixels of 512 x 512). The others are choices of this library: of radii from 0.1 to 1.5 sides,
    0.5 errs least against all texels in the scenes parlour and workshop. Weights add up to the
    texels that the disk covers.
    """

    samples: int = param(400, "texels of each map that a pixel gathers from", low=1, high=65536)
    radius: float = param(
        0.5,
        "of the disk round the pixel's place in the map, r_max",
        unit="sides of a face of the map",
        low=0.0,
        above=True,
        high=4.0,
    )
    offset: float = param(
        1.0,
        "by which lights move along minus their normal, against the singularity in corners",
        unit="widths of a texel's surface",
        low=0.0,
        high=1e6,
    )
    spacing: int = param(
        8,
        "between the pixels of the low-resolution pass; 1: light is gathered for every pixel",
        unit="px",
        low=1,
        high=64,
    )
    position_tolerance: float = param(
        2.0,
        "distance in space up to which a low-resolution pixel is near",
        unit="spacings, as large as they are at the pixel's depth",
        low=0.0,
        high=1e6,
    )
    normal_tolerance: float = param(
        0.2, "angle between normals up to which they are similar", unit="radians", low=1e-3, high=3.0
    )


class RsmPublished(RsmTechnique[RsmPublishedParams]):
    """Gathering as published, prepared for images of one size; see `RsmTechnique` for the arguments.

    Dachsbacher and Stamminger 2005, "Reflective Shadow Maps": E = sum of flux / pi max(0, n_p . (x
    - x_p)) max(0, n . (x_p - x)) / |x - x_p|^4 over samples in a disk round the pixel's place in
    the map, at radius xi1 with the weight xi1^2, renormalised; the same pattern for all pixels; a
    low-resolution pass, interpolation where three or four of its pixels are suitable, gathering for
    the rest. Departs: the low-resolution image has pixels of the full-size one, and the maps of
    point lights, which the paper has not, are sampled in a cap of directions.
    """

    name = "rsm published"
    defaults = RsmPublishedParams

    def _prepare(self) -> None:
        self._lattice = Level(self.runtime, 0, self.params.spacing, self.size, 3)
        self._rest = Level(self.runtime, 1, 1, self.size, 3)
        self._choose = self.runtime.kernel("rsm/rsm_published_lattice.cl")
        self._interpolate = self.runtime.kernel("rsm/rsm_published_interpolate.cl", structs=(CAMERA, INTERPOLATE))

    def _sampling(self, params: RsmPublishedParams) -> MapSampling:
        return MapSampling(
            pattern="fixed", samples=params.samples, radius=params.radius, weights="paper", offset=params.offset
        )

    @property
    def computed(self) -> float:
        """Share of all pixels that the latest run gathered for. Waits for the device."""
        levels = (self._lattice,) if self.params.spacing == 1 else (self._lattice, self._rest)
        return sum(int(level.list.download()[0]) for level in levels) / math.prod(self.size)

    def _gathered(self, gbuffer: DeviceGBuffer, camera: Camera) -> Plane:
        grid = (self.size[0], -(-self.size[1] // TILE))
        self._lattice.mark(
            self._choose,
            grid,
            depth=gbuffer.depth,
            whole=gbuffer.whole,
            margin=gbuffer.margin,
            step=self.params.spacing,
        )
        self._maps.gather(gbuffer, camera, self._lattice.values, self._lattice)
        if self.params.spacing == 1:
            return self._lattice.values
        self._rest.mark(
            self._interpolate,
            grid,
            depth=gbuffer.depth,
            normal=gbuffer.normal,
            lattice=self._lattice.values,
            whole=gbuffer.whole,
            camera=gbuffer.camera_struct,
            params=self._limits(gbuffer),
        )
        self._maps.gather(gbuffer, camera, self._rest.values, self._rest)
        return self._rest.values

    def _limits(self, gbuffer: DeviceGBuffer) -> np.ndarray:
        """Return the limits up to which low-resolution pixels are suitable."""
        params, camera = self.params, gbuffer.camera_struct
        pixel = max(abs(float(camera["to_x"])), abs(float(camera["to_y"])))
        values = {
            "reach": (params.position_tolerance * params.spacing * pixel) ** 2,
            "cosine": math.cos(params.normal_tolerance),
            **margin_values(gbuffer.margin),
            "step": params.spacing,
        }
        return INTERPOLATE.pack(values)
