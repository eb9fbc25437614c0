"""Sequences in the layout of the public BMFR data: `python -m ssgi_cl.bench.experiments.bmfr --help`.

Koskela et al. 2019, "Blockwise Multi-Order Feature Regression for Real-Time Path Tracing Reconstruction", published
sequences of 60 frames with one path a pixel. A folder has, for each frame n from 0 on, colorN.exr, albedoN.exr,
shading_normalN.exr and world_positionN.exr (three channels each, world space), and camera_matrices.h with 4 x 4 numbers
a frame, by which a row [x y z 1] becomes homogeneous coordinates: (x / w + 1) / 2 of the columns from the left and
(y / w + 1) / 2 of the rows from row 0 on.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.experiments import steadiness
from ssgi_cl.bench.wording import markdown
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.history import History
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.techniques.temporal.accumulate import accumulate

Image = NDArray[np.float32]
Doubles = NDArray[np.float64]

HEADER = "camera_matrices.h"
WITHIN = 1.0
"""Pixels from a pixel's middle within which its position has to lie, so that it shows a surface."""
DARKEST = 1e-3
"""Albedo by which radiance is divided at least."""


@dataclass(frozen=True)
class Frame:
    """A frame of a sequence, row 0 on top.

    Attributes:
        gbuffer: depth, normals and albedo.
        color: [rows, columns, 3] noisy radiance.
    """

    gbuffer: GBuffer
    color: Image


def matrices(path: Path) -> Doubles:
    """Return the matrices [frames, 4, 4] of a header. ValueError: there are none, or numbers are missing."""
    text = re.sub(r"//[^\n]*", "", path.read_text())
    found = re.search(r"camera_matrices\s*\[[^=]*=\s*(\{.*?\})\s*;", text, flags=re.DOTALL)
    numbers = re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", found[1]) if found else []
    if not numbers or len(numbers) % 16:
        raise ValueError(
            f"{path} has {len(numbers)} numbers for camera_matrices: expected 16 for each frame, at least one"
        )
    return np.array(numbers, np.float64).reshape(-1, 4, 4)


def camera_of(matrix: Doubles, width: int, height: int) -> tuple[Camera, bool]:
    """Return the camera of a matrix, and whether its images lie upside down."""
    rows, shift = matrix[:3, [0, 1, 3]].T, matrix[3, [0, 1, 3]]
    scale = float(np.linalg.norm(rows[2]))
    if not scale > 0.0:
        raise ValueError(f"camera matrix is {matrix.tolist()}: expected that of a perspective camera")
    rows, shift = rows / scale, shift / scale
    forward = rows[2]
    middle_y, middle_x = float(rows[1] @ forward), float(rows[0] @ forward)
    down, right = rows[1] - middle_y * forward, rows[0] - middle_x * forward
    across, along = float(np.linalg.norm(right)), float(np.linalg.norm(down))
    right, down = right / across, down / along
    turned = bool(np.cross(right, down) @ forward < 0.0)
    if turned:
        down, middle_y = -down, -middle_y
    view = np.eye(4)
    view[:3, :3] = (right, -down, -forward)
    view[:3, :3] = _orthogonal(view[:3, :3])
    view[:3, 3] = view[:3, :3] @ np.linalg.solve(rows, shift)
    camera = Camera.from_intrinsics(
        across * width / 2.0,
        along * height / 2.0,
        (1.0 + middle_x) * width / 2.0,
        (1.0 + middle_y) * height / 2.0,
        width=width,
        height=height,
        view=view,
    )
    return camera, turned


def _orthogonal(matrix: Doubles) -> Doubles:
    """Return the rotation that is nearest to a matrix of rounded numbers."""
    left, _, right = np.linalg.svd(matrix)
    result: Doubles = left @ right
    return result


def frames_of(folder: Path) -> Iterator[Frame]:
    """Yield the frames of a folder, as many as have a matrix and a color.

    Raises:
        FileNotFoundError: the header, the first color, or what belongs to a color is missing.
        ValueError: a file without three channels, sizes that differ, or positions that the matrices do not lead to.
    """
    for number, matrix in enumerate(matrices(folder / HEADER)):
        if number and not (folder / f"color{number}.exr").exists():
            return
        color, albedo, normal, position = (
            image(folder / f"{name}{number}.exr") for name in ("color", "albedo", "shading_normal", "world_position")
        )
        sizes = {array.shape for array in (color, albedo, normal, position)}
        if len(sizes) > 1:
            raise ValueError(f"the images of frame {number} in {folder} have shapes {sorted(sizes)}: expected one")
        camera, turned = camera_of(matrix, color.shape[1], color.shape[0])
        if turned:
            color, albedo, normal, position = (array[::-1] for array in (color, albedo, normal, position))
        depth = depths(position, camera)
        if not np.isfinite(depth).any():
            raise ValueError(
                f"no position of frame {number} in {folder} lies in its own pixel: the matrix is another's"
            )
        gbuffer = GBuffer(camera=camera, depth=depth, normal=normal, albedo=np.clip(albedo, 0.0, 1.0))
        yield Frame(gbuffer, np.ascontiguousarray(color))


def depths(position: Image, camera: Camera) -> Image:
    """Return the depths of positions [rows, columns, 3]; infinite where they are not before the pixel's middle."""
    seen = position.astype(np.float64) @ camera.view[:3, :3].T + camera.view[:3, 3]
    depth = -seen[..., 2]
    ahead = depth > 0.0
    sx, sy, ox, oy = camera.pixel_to_view
    safe = np.where(ahead, depth, 1.0)
    row, column = np.indices(depth.shape) + 0.5
    off = np.maximum(np.abs((seen[..., 0] / safe - ox) / sx - column), np.abs((seen[..., 1] / safe - oy) / sy - row))
    return np.where(ahead & (off <= WITHIN), depth, np.inf).astype(np.float32)


def image(path: Path) -> Image:
    """Return the three channels of a file, R, G, B or X, Y, Z. ValueError: it has others."""
    channels = exr.read(path)
    for names in ("RGB", "XYZ"):
        if set(names) <= set(channels):
            return np.stack([channels[name] for name in names], axis=-1).astype(np.float32)
    raise ValueError(f"{path} has channels {sorted(channels)}: expected R, G, B or X, Y, Z")


def accumulated(frames: Iterator[Frame], runtime: Runtime) -> Iterator[tuple[Frame, Image]]:
    """Yield frames with their radiance as a mean over frames; it is averaged before it meets the albedo."""
    history: History | None = None
    before: GBuffer | None = None
    for frame in frames:
        albedo = np.maximum(np.asarray(frame.gbuffer.albedo, np.float32), np.float32(DARKEST))
        mean, history = accumulate(frame.color / albedo, frame.gbuffer, before, history, runtime=runtime)
        before = frame.gbuffer
        yield frame, mean * albedo


@click.command()
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False, exists=True))
@click.option(
    "--reference", required=True, help="Path of the references without number and .exr, such as refs/reference."
)
@click.option("--first", default=8, show_default=True, type=click.IntRange(0, 1000), help="Frame that counts first.")
def main(folder: Path, reference: str, first: int) -> None:
    """Print RMSE and temporal noise of the sequence in FOLDER, one path a pixel, with a history and without."""
    runtime = Runtime.open()
    images: dict[str, list[Image]] = {"1 path": [], "1 path, history": []}
    wanted, masks = [], []
    for number, (frame, mean) in enumerate(accumulated(frames_of(folder), runtime)):
        if number >= first:
            truth = image(Path(f"{reference}{number}.exr"))
            wanted.append(truth[::-1] if camera_of(matrices(folder / HEADER)[number], 1, 1)[1] else truth)
            masks.append(np.isfinite(np.asarray(frame.gbuffer.depth)))
            images["1 path"].append(frame.color)
            images["1 path, history"].append(mean)
    lines = [
        (name, f"{steadiness.rmse(own, wanted, masks):.4f}", f"{steadiness.temporal_noise(own, wanted, masks):.4f}")
        for name, own in images.items()
    ]
    click.echo("\n".join(markdown(("method", "RMSE", "temporal noise"), lines, "lrr")))


if __name__ == "__main__":
    main()
