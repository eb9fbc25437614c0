"""Limits of OpenCL images on a device, and the image that holds a plane."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from typing import Any

from ssgi_cl.core.errors import DeviceError

VARIABLE = "SSGI_CL_IMAGE_LIMIT"
"""Lowers the limits for tests: ROWSxCOLUMNS, or one number for both."""


@dataclass(frozen=True)
class ImageLimits:
    """The largest 2D image of a device.

    A plane's rows lie one below the other in an image. Those from number `rows` on start a second
    column of rows, to the right of the first, and so on.

    Attributes:
        rows: of an image; a power of two, so that kernels find a row by a shift. They know it as
            SSGI_IMAGE_ROWS.
        columns: elements in a row.
        size: bytes of a single allocation.
    """

    rows: int
    columns: int
    size: int

    @classmethod
    def of(cls, device: Any) -> ImageLimits:
        """Return those of an OpenCL device, lowered as the variable SSGI_CL_IMAGE_LIMIT says.

        The device's are CL_DEVICE_IMAGE2D_MAX_HEIGHT, CL_DEVICE_IMAGE2D_MAX_WIDTH and
        CL_DEVICE_MAX_MEM_ALLOC_SIZE. A driver may derive them from the free memory, so they may
        differ between two runs.

        Raises:
            ValueError: the variable is no such limit.
        """
        rows, columns = device.image2d_max_height, device.image2d_max_width
        if asked := os.environ.get(VARIABLE):
            found = re.fullmatch(r"([1-9]\d*)(?:x([1-9]\d*))?", asked)
            if found is None:
                raise ValueError(
                    f"{VARIABLE} is {asked!r}: expected elements, such as 2048, or rows x columns, such as 64x2048"
                )
            rows = min(rows, int(found[1]))
            columns = min(columns, int(found[2] or found[1]))
        return cls(1 << (rows.bit_length() - 1), columns, device.max_mem_alloc_size)

    def shape(self, label: str, rows: int, pitch: int) -> tuple[int, int]:
        """Return (rows, columns) of the image that holds `rows` rows of `pitch` elements (float32).

        Raises:
            DeviceError: the device named `label` has no image so large.
        """
        shape = min(rows, self.rows), -(-rows // self.rows) * pitch
        if shape[1] > self.columns:
            raise DeviceError(
                f"{label} has images of at most {self.rows} rows and {self.columns} columns: a "
                f"plane of {rows} rows of {pitch} elements needs {shape[1]} columns; use storage "
                "'buffer', or fewer pixels or layers"
            )
        if shape[0] * shape[1] * 4 > self.size:
            raise DeviceError(
                f"{label} has images of at most {self.size} bytes: a plane of {rows} rows of "
                f"{pitch} elements needs {shape[0] * shape[1] * 4}; use storage 'buffer', or fewer "
                "pixels or layers"
            )
        return shape
