"""Ambient occlusion with a visibility bitmask: surfaces have a thickness, light passes behind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self, Unpack

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import Preset
from ssgi_cl.core.params import param, with_fields_described
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.techniques.ao.occlusion import made_for
from ssgi_cl.techniques.ao.occlusion_bands import occlusion_plan
from ssgi_cl.techniques.ao.slices import PRESET_LAYERS, TUNABLE, SliceKeywords, SliceParams, SliceTechnique, slice_reach
from ssgi_cl.techniques.bands import banded
from ssgi_cl.techniques.filters.bilateral import BilateralParams
from ssgi_cl.techniques.technique import Bench, Technique

SECTORS = ("cosine", "angle")
ENDS = ("thickness", "layer")
MOST_TAPS = 64
"""Of a side of a slice."""
KNOWN_SLACK = 0.5
"""Of `slack`, where several layers have a thickness by pixel: the tap behind a solid is rarely of its surface."""
JOINED_SIGMA = 0.4
"""Standard deviation of the blur of joined taps over its radius and a half pixel on either side."""


@dataclass(frozen=True, kw_only=True)
class BitmaskParams(SliceParams):
    """Parameters of the visibility bitmask (Therrien et al. 2023).

    Joined taps find less between them than a horizon does: 14 a side come within a tenth of what
    rays find in one depth layer. More layers make the first one's gaps tell: joined, it is read at
    24 of two layers, at 28 of four (at most 64), each of the others at a third of that.

    Thickness, slack and end were chosen on generated scenes: with two and four layers the RMSE is
    3 and 7 % less on those for tuning than with .2, .35 and "thickness", and 6 and 9 % less on
    those for validation; thin rods and wires are no walls.
    """

    taps: int = param(
        14, "depths read on either side of a slice; of several layers' first one more, see above", low=1, high=MOST_TAPS
    )
    tap_power: float = param(1.6, "taps lie at u^tap_power of the radius, u evenly spread", low=0.1, high=8.0)
    thickness: float = param(
        0.15,
        "of surfaces, along the view direction; with `joined`, of those that one tap meets",
        low=0.0,
        high=1e3,
        unit="radii",
    )
    end: str = param(
        "layer",
        "where such surfaces end: `thickness` behind their front (that of each pixel "
        "where the G-buffer has it), or at the next depth layer if that is nearer",
        choices=ENDS,
    )
    joined: bool = param(True, "surfaces cover what lies between neighbouring taps")
    slack: float = param(
        0.2, "depth by which a surface may miss the line through its other taps", low=0.0, high=1e3, unit="radii"
    )
    sectors: str = param(
        "cosine",
        "the 32 sectors of a slice are equal parts of the cosine-weighted measure, or "
        "equal angles as published, all directions of a slice weighing the same",
        choices=SECTORS,
    )

    def in_front_of(self, layers: int) -> Self:
        """Return the parameters with which the first of so many depth layers is read."""
        if not self.joined or layers == 1:
            return self
        return replace(self, taps=min(round(self.taps * (10 + layers) / 7), MOST_TAPS))

    def beside_known(self, layers: int) -> Self:
        """Return the parameters with which layers are read of which so many have a thickness by pixel."""
        if layers < 2:
            return self
        return replace(self, slack=self.slack * KNOWN_SLACK)

    def deeper(self, layers: int) -> int:
        """Return the most taps of a side in each of so many layers but the first."""
        front = self.in_front_of(layers).taps
        return -(-front // 3) if self.joined and layers > 1 else front

    @property
    def blur(self) -> BilateralParams:
        """Parameters of the blur of A: a narrower one suffices for joined taps, which have less noise."""
        blur = super().blur
        return replace(blur, sigma=JOINED_SIGMA * (blur.radius + 1)) if self.joined else blur

    @property
    def overshoot(self) -> float:
        """Shift of the taps: half of the last ones lie beyond the radius, where surfaces end."""
        return 0.5 if self.joined else 0.0


class BitmaskKeywords(SliceKeywords, total=False):
    """The other parameters of `bitmask_ao`."""

    thickness: float
    end: str
    joined: bool
    slack: float
    sectors: str


class BitmaskAo(SliceTechnique[BitmaskParams]):
    """Bitmask AO, prepared for images of one size; see `OcclusionTechnique` for the arguments.

    Therrien et al. 2023. Departs: see `bitmask_ao`.
    """

    name = "bitmask_ao"
    defaults = BitmaskParams
    reads_thickness = True

    def _macros(self) -> Mapping[str, int]:
        params = self.params
        return {
            "BITMASK_ANGLE": SECTORS.index(params.sectors),
            "BITMASK_JOINED": int(params.joined),
            "SLICES_DEEPER": params.deeper(self.layers),
            "SLICES_NEXT": int(params.end == "layer" and self.layers > 1),
        }

    def _values(self, *, thick: int) -> Mapping[str, float]:
        params = self.params.beside_known(min(thick, self.layers))
        return {"thickness": params.thickness, "slack": params.slack}


@banded(occlusion_plan(BitmaskAo, slice_reach))
@with_fields_described(BitmaskParams)
@serialised
def bitmask_ao(
    gbuffer: GBuffer | DeviceGBuffer,
    radius: float | None = None,
    slices: int | None = None,
    taps: int | None = None,
    *,
    preset: Preset | None = None,
    error: float | None = None,
    budget_ms: float | None = None,
    max_memory: int | None = None,
    runtime: Runtime | None = None,
    **params: Unpack[BitmaskKeywords],
) -> NDArray[np.float32]:
    """Compute ambient occlusion from the sectors of slices that surfaces of some thickness cover.

    Therrien et al. 2023, "Screen Space Indirect Lighting with Visibility Bitmask". Departs: sectors
    are equal parts of the cosine-weighted measure (`sectors="angle"`: equal angles, as published);
    neighbouring taps on one surface cover what lies between them; all depth layers are read.

    Args:
        gbuffer: depth, and normals if there are any; taps reach into its margin, and each covers
            sectors with every depth layer.
        radius: distance up to which surfaces occlude, scene units, > 0; by default 5 % of the
            picture's diagonal where surfaces are seen.
        slices: planes through the view ray, 1 to 32.
        taps: depths read on either side of a slice, 1 to 64; of several layers see `BitmaskParams`.
        preset, error, budget_ms: at most one of them: where the fields that are not given come
            from. "low", "medium", "high" or "ultra"; the greatest RMSE against cast rays, > 0; the
            longest device time of a picture in ms, > 0. See `ssgi_cl.choose`. By default the
            defaults of `BitmaskParams`.
        max_memory: most bytes of device memory; where the image needs more, it is computed in bands
            of rows; the result is bit-identical. By default all that the device has.
        runtime: the device; by default the fastest found.
        **params: the other fields of `BitmaskParams`.

    Returns:
        A [rows, columns] float32 in [0, 1]: 1 = open, and where nothing is there.

    Raises:
        TypeError, ValueError: a parameter of the wrong type or out of range; the message says
            which, its value and what is allowed.
    """
    technique, device = made_for(
        BitmaskAo,
        gbuffer,
        runtime,
        radius=radius,
        slices=slices,
        taps=taps,
        preset=preset,
        error=error,
        budget_ms=budget_ms,
        **params,
    )
    return technique(device)


DESCRIPTOR = Technique(
    name="bitmask_ao",
    kind="ao",
    paper="Therrien et al. 2023",
    function=bitmask_ao,
    params=BitmaskParams,
    technique=BitmaskAo,
    reference="ssgi_cl.reference.ao.bitmask_ao",
    reads=("depth", "normal", "thickness"),
    writes=("ao",),
    command=True,
    quantity="occlusion",
    bench=Bench(
        settings=("1x9", "2x9", "2x14", "4x20", "2x14-2", "2x14-4", "4x20-4"),
        families=("bitmask_ao",),
        rows={
            "bitmask_ao": (
                "ambient occlusion from 32 sectors a slice that surfaces cover",
                (("", "bitmask_ao.2x14"), ("2 layers", "bitmask_ao.2x14-2"), ("4 layers", "bitmask_ao.2x14-4")),
            )
        },
    ),
    variants={"taps": (6,), "resolution": ("full", "half")},
    tunable=TUNABLE,
    layers=PRESET_LAYERS,
)
