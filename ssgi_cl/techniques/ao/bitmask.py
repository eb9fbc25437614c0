"""Visibility bitmask: its parameters, and the technique prepared for images of one size; see `bitmask_ao`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

from ssgi_cl.core.params import param
from ssgi_cl.techniques.ao.slices import ScanParams, SliceKeywords, SliceTechnique
from ssgi_cl.techniques.filters.bilateral import BilateralParams

SECTORS = ("cosine", "angle")
ENDS = ("thickness", "layer")
JOINED_SIGMA = 0.4
"""Standard deviation of the blur of many joined slices over its radius and a pixel."""
FEW_SLICES = 2
"""Up to so many are blurred by the mean of the tile: without it floors and walls have dots."""
MOST_TAPS = 64
"""Of a side of a slice."""
KNOWN_SLACK = 0.5
"""Of `slack`, where several layers have a thickness by pixel: the tap behind a solid is rarely of its surface."""


@dataclass(frozen=True, kw_only=True)
class BitmaskParams(ScanParams):
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
        """Parameters of the blur of A: a narrower one suffices for more joined slices, which have less noise."""
        blur = super().blur
        narrow = self.joined and self.slices > FEW_SLICES
        return replace(blur, sigma=JOINED_SIGMA * (blur.radius + 1)) if narrow else blur

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
