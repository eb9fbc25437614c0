"""Frame: a picture and the arrays that it was made from."""

from __future__ import annotations

import io
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.formats import files
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.timing import PassTime
from ssgi_cl.frame.record import GraphRecord
from ssgi_cl.techniques.filters.tonemap import tonemap


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Frame:
    """A rendered picture and what it was made from.

    Attributes:
        ao: A [rows, columns] float32 in [0, 1], or None if it was not needed, as with SSDO.
        indirect: irradiance by light that surfaces reflect, [rows, columns, 3] float32 in W/m^2, or
            None if it was not computed.
        gbuffer: surfaces that the camera sees, or None if it was not asked for.
        levels: distance in pixels between the points that "multires" computed, [rows, columns] int32, 0
            where it interpolated; with the G-buffer, else None.
        counts: frames that the means of ambient occlusion and light stand for, [rows, columns] float32 >= 1, or None
            without a history.
        resets: why they begin anew, [rows, columns] uint8, sums of `Reset`, or None likewise.
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
    counts: NDArray[np.float32] | None = None
    resets: NDArray[np.uint8] | None = None

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

    def arrays(self) -> dict[str, NDArray[np.float32]]:
        """Return what there is of it by the names that files have: "image" (radiance), "ao", "indirect", and
        "depth", "normal", "albedo" and "emission" of the G-buffer without its margin."""
        found = {"image": self._radiance, "ao": self.ao, "indirect": self.indirect}
        if self.gbuffer is not None:
            for name in ("depth", "normal", "albedo", "emission"):
                array = self.gbuffer.first(name)
                found[name] = None if array is None else self.gbuffer.inner(array)
        return {name: array for name, array in found.items() if array is not None}

    def save(self, path: str | os.PathLike[str], *, half: bool = False, parts: bool = False, bits: int = 8) -> None:
        """Write the picture as PNG, or `arrays` as OpenEXR, as the end of the name says; whole or not at all.

        Args:
            path: the file.
            half: of OpenEXR, whether channels but depth are half floats.
            bits: of PNG, 8 or 16 a channel; 16 need "radiance" among the frame's outputs.
            parts: of OpenEXR, whether each array is a part of its own: rgba, ao, depth, N ...

        Raises:
            ValueError: another end of the name, the frame lacks what the file is to hold, or a value is beyond
                the largest half float, 65504.
            OSError: the file can't be written; the message names it.
        """
        end = Path(path).suffix.lower()
        if end == ".png":
            picture = self.image if bits == 8 else tonemap(self.radiance, exposure=self.exposure, bits=bits)
            files().write_picture(path, picture)
        elif end == ".exr":
            camera = None if self.gbuffer is None else self.gbuffer.camera
            files().write(path, self.arrays(), camera=camera, half=half, parts=parts)
        else:
            raise ValueError(f"path is {os.fspath(path)!r}: expected a name that ends in .png or .exr")

    def __repr__(self) -> str:
        held = ["image"] * (self._image is not None) + ["radiance"] * (self._radiance is not None)
        held += [name for name in ("ao", "indirect", "gbuffer") if getattr(self, name) is not None]
        ran = [each for each in self.passes if not each.skipped]
        return (
            f"Frame of {', '.join(held)}: {self.wall_ms:.1f} ms, {len(ran)} passes of "
            f"{sum(each.ms for each in ran):.1f} ms, {len(self.passes) - len(ran)} skipped"
        )

    def _repr_png_(self) -> bytes | None:
        """Return the picture for notebooks."""
        if self._image is None:
            return None
        from PIL import Image

        file = io.BytesIO()
        Image.fromarray(self._image).save(file, format="PNG", compress_level=1)
        return file.getvalue()
