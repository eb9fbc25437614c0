"""Frame: a picture and the arrays that it was made from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.timing import PassTime
from ssgi_cl.frame.record import GraphRecord


@dataclass(frozen=True, eq=False, kw_only=True)
class Frame:
    """A rendered picture and what it was made from.

    Attributes:
        ao: A [rows, columns] float32 in [0, 1], or None if it was not needed, as with SSDO.
        indirect: irradiance by light that surfaces reflect, [rows, columns, 3] float32 in W/m^2, or
            None if it was not computed.
        gbuffer: surfaces that the camera sees, or None if it was not asked for.
        levels: distance in pixels between the points that "multires" computed, [rows, columns] int32, 0
            where it interpolated; with the G-buffer, else None.
        exposure: the factor before the tone curve; 1 if neither it nor light was asked for.
        passes: name and milliseconds of every pass, or why it was skipped.
        wall_ms: milliseconds from the call to the finished arrays.
        graph: the frame graph as it was run: what became of each stage, its time, and resources.
    """

    ao: NDArray[np.float32] | None
    indirect: NDArray[np.float32] | None
    gbuffer: GBuffer | None
    levels: NDArray[np.int32] | None
    exposure: float
    passes: tuple[PassTime, ...]
    wall_ms: float
    graph: GraphRecord
    _image: NDArray[np.uint8] | None
    _radiance: NDArray[np.float32] | None

    @property
    def image(self) -> NDArray[np.uint8]:
        """[rows, columns, 3] uint8, sRGB encoding; ValueError if it was not asked for."""
        if self._image is None:
            raise ValueError("the frame has no image: expected 'image' among its outputs")
        return self._image

    @property
    def radiance(self) -> NDArray[np.float32]:
        """[rows, columns, 3] float32 in W m^-2 sr^-1, not clamped; ValueError likewise."""
        if self._radiance is None:
            raise ValueError("the frame has no radiance: expected 'radiance' among its outputs")
        return self._radiance
