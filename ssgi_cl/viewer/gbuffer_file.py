"""G-buffers of files: .exr, and .npz with arrays by the names of `GBuffer`."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.depth_maps import ASSUMED_YFOV, cameras_of
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.sequences.apply_exr import ApplyExr
from ssgi_cl.sequences.exr_passes import Passes

ENDINGS = (".exr", ".npz")
ARRAYS = ("depth", "normal", "albedo", "emission", "specular", "gloss", "thickness")
"""Names of a G-buffer's arrays in an .npz file; `depth` is needed."""


def load_gbuffer(path: Path) -> GBuffer:
    """Return the G-buffer of a file.

    An .npz file holds `depth` and any other of `ARRAYS` as `GBuffer` has them, and of the camera `K` (3 x 3, pixels,
    as in OpenCV), `yfov` (radians) or `projection` (4 x 4), and `view` (4 x 4, world to view). A file that says
    nothing of the camera is seen at 50 degrees.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: damaged, without depth, or an array of a wrong shape or range.
    """
    if not path.is_file():
        raise FileNotFoundError(2, "there is no such file", str(path))
    return _from_npz(path) if path.suffix.lower() == ".npz" else _from_exr(path)


def _from_exr(path: Path) -> GBuffer:
    # SSDO reads all that lights need: the arrays are found, and their conventions told, as by `ssgi apply`.
    return ApplyExr(technique="ssdo", parameters={}, passes=Passes()).read_whole(path).gbuffer


def _from_npz(path: Path) -> GBuffer:
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except (ValueError, zipfile.BadZipFile, EOFError, KeyError) as error:
        raise ValueError(f"{path} cannot be read: expected a file of arrays by numpy.savez ({error})") from error
    if "depth" not in arrays:
        raise ValueError(f"{path} has {', '.join(arrays) or 'nothing'}: expected 'depth' among its arrays")
    rows, columns = arrays["depth"].shape[-2:] if arrays["depth"].ndim >= 2 else (1, 1)
    given = {name: arrays[name] for name in ARRAYS if name in arrays}
    return GBuffer(camera=_camera(rows, columns, arrays), nan="hole", **given)


def _camera(rows: int, columns: int, arrays: dict[str, NDArray[np.float64]]) -> Camera:
    """Return the camera that arrays of a file describe."""
    view = np.asarray(arrays["view"], np.float64) if "view" in arrays else np.eye(4)
    if "projection" in arrays:
        return Camera(view=view, projection=np.asarray(arrays["projection"]), width=columns, height=rows)
    K, yfov = arrays.get("K"), arrays.get("yfov", ASSUMED_YFOV)
    (camera,) = cameras_of(
        (rows, columns), None, K, "pixels", None if K is not None else float(yfov), None, None, view, []
    )
    return camera
