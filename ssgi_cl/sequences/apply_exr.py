"""A technique on the G-buffer of an OpenEXR file, as `ssgi apply` does it, for one file or each of a sequence."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, field, replace
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.gbuffer_exr import interpret
from ssgi_cl.core.lights import DirectionalLight, Environment, Light
from ssgi_cl.core.normal_space import SAME
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.io.console import DEFAULT_FOV
from ssgi_cl.io.exr_header import ExrHeader, read_headers
from ssgi_cl.rasterize.raster.default_camera import camera_from_json
from ssgi_cl.sequences.frame_result import FrameFile
from ssgi_cl.techniques.catalogue import CATALOGUE
from ssgi_cl.techniques.technique import Technique


@dataclass(frozen=True, kw_only=True)
class Passes:
    """What is read of a file, and how.

    Attributes:
        yfov: vertical field of view of the display window, radians; None for the camera of the header, or 50
            degrees.
        view_height: of an orthographic camera, scene units.
        intrinsics: fx, fy, cx, cy of the display window, pixels.
        camera_file: a camera in JSON.
        channels, layer, part, layout, normal_space, depth_kind, depth_range: as of `GBuffer.from_exr`.
        invalid: depths that stand for nothing.
        nan: as of `GBuffer`.
        normals: whether normals are read.
    """

    yfov: float | None = None
    view_height: float | None = None
    intrinsics: tuple[float, ...] | None = None
    camera_file: Path | None = None
    channels: Mapping[str, str | tuple[str, ...]] = field(default_factory=dict)
    layer: str | None = None
    part: str | None = None
    layout: str | None = None
    normal_space: str | None = None
    depth_kind: str | None = None
    depth_range: tuple[float, float] | None = None
    invalid: tuple[float, ...] = ()
    nan: str = "refuse"
    normals: bool = True


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
    """

    technique: str
    parameters: Mapping[str, Any]
    passes: Passes
    lights: tuple[Light, ...] = ()
    lit: bool = False
    device: str | None = None

    @property
    def chosen(self) -> Technique:
        """The technique."""
        return CATALOGUE[self.technique]

    def read(self, source: Path) -> Frame:
        """Return what a file holds of what the technique reads. ValueError, OSError: as of `exr.read_gbuffer`."""
        passes = self.passes
        axes, camera, said = _camera(source, passes)
        with redirect_stdout(StringIO()):  # OpenEXR prints warnings there; errors are raised too
            arrays, expected = exr.read_with_kind(
                source, passes.channels, layer=passes.layer, part=passes.part, layout=passes.layout
            )
        notes = [said, *arrays.pop("notes")]
        for number in passes.invalid:
            arrays["depth"][arrays["depth"] == np.float32(number)] = np.inf
        # What the technique does not read may hold anything.
        unused = [name for name in ("albedo", "emission") if name not in self.chosen.reads]
        for name in unused if passes.normals else (*unused, "normal"):
            arrays.pop(name, None)
        try:
            notes += interpret(
                arrays, camera, expected, axes, passes.normal_space, passes.depth_kind, passes.depth_range
            )
        except ValueError as error:
            words = str(error).replace("normal_space", "--normals")
            words = words.replace("depth_kind=", "--depth ").replace("depth_range=", "--depth-range ")
            raise ValueError(f"{source}: {words}") from None
        gbuffer = GBuffer(camera=camera, nan=passes.nan, **arrays)  # type: ignore[arg-type]
        return Frame(source, gbuffer, _image(source) if self.lit else None, tuple(notes))

    def __call__(self, frame: Frame) -> FrameFile:
        """Return the channels of the result, for a file with the attributes of the input."""
        return FrameFile(self.compute(frame, Runtime.open(self.device)), like=frame.source)

    def compute(self, frame: Frame, runtime: Runtime) -> dict[str, Any]:
        """Return what the technique finds, by the names that it has in a file."""
        chosen, inputs, parameters = self.chosen, [frame.gbuffer], dict(self.parameters)
        if "lights" in chosen.reads:
            parameters["radiance"] = frame.radiance
            inputs.append(list(self.lights) or ([] if self.lit else [Environment(1.0)]))  # type: ignore[arg-type]
        result = chosen.function(*inputs, runtime=runtime, **parameters)
        results = result if isinstance(result, tuple) else (result,)
        channels = dict(zip(chosen.writes, results, strict=False))  # the last ones are optional
        bent = channels.pop("bent", None)
        if bent is not None:
            channels |= {f"bent.{axis}": bent[..., i] for i, axis in enumerate("XYZ")}
        return channels


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
    with redirect_stdout(StringIO()):
        present = exr.read(path)
    missing = [name for name in "RGB" if name not in present]
    if missing:
        raise ValueError(f"{path} has no channel {missing[0]}, which --lit needs; it has {', '.join(present)}")
    return np.stack([present[name].astype(np.float32, copy=False) for name in "RGB"], axis=-1)


def _camera(source: Path, passes: Passes) -> tuple[NDArray[np.float64] | None, Camera, str]:
    """Return [3, 3] from the file's world to the camera's (None if unknown), the camera of the data window, and a note.

    Options are of the display window; without any it is the one in the file's header.
    """
    header = read_headers(source)[0]
    left, top, right, bottom = header.display
    rows, columns = header.size
    window = header.data[0] - left, header.data[1] - top, columns, rows
    file = passes.camera_file
    if file is not None:
        return SAME, camera_from_json(file, right - left + 1, bottom - top + 1).cropped(*window), f"camera: {file}"
    if (passes.yfov, passes.view_height, passes.intrinsics) == (None, None, None):
        found = exr.read_camera(source)
        if found.camera is not None:
            camera, size = found.camera, header.size
            return found.axes, camera if camera.size == size else camera.cropped(*window), found.note
        said = f"camera: {DEFAULT_FOV:g} degrees high are assumed, see --fov" + (
            f" ({found.note})" if found.note else ""
        )
        return None, _given_camera(header, passes), said
    return None, _given_camera(header, passes), "camera: as the options say"


def _given_camera(header: ExrHeader, passes: Passes) -> Camera:
    """Return the camera of the data window, from values of the display window."""
    left, top, right, bottom = header.display
    size: dict[str, Any] = {"width": right - left + 1, "height": bottom - top + 1}
    eye, target = (0.0, 0.0, 0.0), (0.0, 0.0, -1.0)
    if passes.intrinsics is not None:
        camera = Camera.from_intrinsics(*passes.intrinsics, **size)
    elif passes.view_height is not None:
        camera = Camera.orthographic(eye, target, view_height=passes.view_height, **size)
    else:
        yfov = math.radians(DEFAULT_FOV) if passes.yfov is None else passes.yfov
        camera = Camera.look_at(eye, target, yfov=yfov, **size)
    if header.pixel_aspect != 1.0 and passes.intrinsics is None:
        stretched = np.diag([1.0 / header.pixel_aspect, 1.0, 1.0, 1.0]) @ camera.projection
        camera = replace(camera, projection=stretched)
    rows, columns = header.size
    return camera.cropped(header.data[0] - left, header.data[1] - top, columns, rows)
