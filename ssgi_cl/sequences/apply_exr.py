"""A technique on the G-buffer of an OpenEXR file, as `ssgi apply` does it, for one file or each of a sequence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.io.console import silent
from ssgi_cl.sequences.exr_image import ExrImage
from ssgi_cl.sequences.exr_passes import Passes, camera_of, interpreted
from ssgi_cl.sequences.frame_result import FrameFile, FrameRows
from ssgi_cl.techniques.bands import memory_limit
from ssgi_cl.techniques.catalogue import CATALOGUE
from ssgi_cl.techniques.technique import Technique


class Frame(NamedTuple):
    """What was read of a file.

    Attributes:
        source: the file.
        gbuffer: of it.
        radiance: [rows, columns, 3], the file's R, G and B, where they are asked for.
        notes: what was read and found.
    """

    source: Path
    gbuffer: GBuffer
    radiance: NDArray[np.float32] | None
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class ApplyExr:
    """Applies a technique; a function for `map_frames`, which reads ahead.

    Attributes:
        technique: its name.
        parameters: of its function.
        passes: what is read.
        lights: of techniques with lights.
        lit: whether the file's R, G and B are the light that surfaces send.
        device: as of `Runtime.open`.
        max_memory: bytes; with it files are read, computed and written by bands of rows.
    """

    technique: str
    parameters: Mapping[str, Any]
    passes: Passes
    lights: tuple[Light, ...] = ()
    lit: bool = False
    device: str | None = None
    max_memory: int | None = None

    def __post_init__(self) -> None:
        if self.max_memory is not None:
            memory_limit(self.max_memory)
            if self.chosen.kind != "ao":
                raise ValueError(f"max_memory is {self.max_memory}: expected None with {self.technique}")
            if self.parameters.get("confidence"):
                raise ValueError(f"max_memory is {self.max_memory}: expected None with confidence, of the whole image")

    @property
    def chosen(self) -> Technique:
        """The technique."""
        return CATALOGUE[self.technique]

    def read(self, source: Path) -> Frame | ExrImage:
        """Return what a file holds of what the technique reads. ValueError, OSError: as of `exr.read_gbuffer`."""
        if self.max_memory is None:
            return self.read_whole(source)
        axes, camera, said = camera_of(source, self.passes)
        return ExrImage(source, camera, axes, self.passes, self.stored, said)

    def read_whole(self, source: Path) -> Frame:
        """Return what `read` does, of the whole image in memory."""
        axes, camera, said = camera_of(source, self.passes)
        arrays, expected, notes = self.stored(source)
        passes = self.passes
        notes += interpreted(arrays, source, camera, expected, axes, passes, passes.normal_space, passes.depth_kind)
        gbuffer = GBuffer(camera=camera, nan=passes.nan, **arrays)  # type: ignore[arg-type]
        return Frame(source, gbuffer, _image(source) if self.lit else None, (said, *notes))

    def stored(self, source: Path, rows: tuple[int, int] | None = None) -> tuple[dict[str, Any], str, list[str]]:
        """Return the arrays that the technique reads as a file has them, the expected kind of depth, and notes."""
        passes = self.passes
        with silent():  # OpenEXR prints warnings there; errors are raised too
            arrays, expected = exr.read_with_kind(
                source, passes.channels, layer=passes.layer, part=passes.part, layout=passes.layout, rows=rows
            )
        notes = list(arrays.pop("notes"))
        for number in passes.invalid:
            arrays["depth"][arrays["depth"] == np.float32(number)] = np.inf
        # What the technique does not read may hold anything.
        unused = [name for name in ("albedo", "emission") if name not in self.chosen.reads]
        for name in unused if passes.normals else (*unused, "normal"):
            arrays.pop(name, None)
        return arrays, expected, notes

    def __call__(self, frame: Frame | ExrImage) -> FrameFile | FrameRows:
        """Return the channels of the result, for a file with the attributes of the input."""
        runtime = Runtime.open(self.device)
        if isinstance(frame, ExrImage):
            return FrameRows(self.rows(frame, runtime), like=frame.source)
        return FrameFile(self.compute(frame, runtime), like=frame.source)

    def rows(self, image: ExrImage, runtime: Runtime) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the first row, and what the technique finds, of one band after the other."""
        assert self.max_memory is not None  # noqa: S101  an image is read by rows with it alone
        for rows in image.each_band(self.chosen, self.parameters, runtime, self.max_memory):
            yield rows.first, self._named(rows.found)

    def compute(self, frame: Frame, runtime: Runtime) -> dict[str, Any]:
        """Return what the technique finds, by the names that it has in a file."""
        chosen, inputs, parameters = self.chosen, [frame.gbuffer], dict(self.parameters)
        if "lights" in chosen.reads:
            parameters["radiance"] = frame.radiance
            inputs.append(list(self.lights) or ([] if self.lit else [Environment(1.0)]))  # type: ignore[arg-type]
        result = chosen.function(*inputs, runtime=runtime, **parameters)
        return self._named(result)

    def _named(self, result: Any) -> dict[str, Any]:
        """Return results by the names that they have in a file."""
        results = result if isinstance(result, tuple) else (result,)
        confidence = {}
        if self.parameters.get("confidence"):
            confidence["confidence"], results = results[-1], results[:-1]
        channels = dict(zip(self.chosen.writes, results, strict=False))  # the last ones are optional
        bent = channels.pop("bent", None)
        if bent is not None:
            channels |= {f"bent.{axis}": bent[..., i] for i, axis in enumerate("XYZ")}
        return channels | confidence


def lights_of(sky: tuple[float, ...] | None, sun: tuple[float, ...] | None) -> tuple[Light, ...]:
    """Return a sky of a radiance (W m^-2 sr^-1), and a sun of a direction and an irradiance (W/m^2)."""
    lights: list[Light] = []
    if sky is not None:
        lights.append(Environment(sky))
    if sun is not None:
        lights.append(DirectionalLight(sun[:3], sun[3]))
    return tuple(lights)


def _image(path: Path) -> NDArray[np.float32]:
    """Return R, G and B of an OpenEXR file, [rows, columns, 3]."""
    with silent():
        present = exr.read(path)
    missing = [name for name in "RGB" if name not in present]
    if missing:
        raise ValueError(f"{path} has no channel {missing[0]}, which --lit needs; it has {', '.join(present)}")
    return np.stack([present[name].astype(np.float32, copy=False) for name in "RGB"], axis=-1)
