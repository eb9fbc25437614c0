"""Blocks of shadow maps: planes that hold all that a block shows between them, and closely."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.device.constants import SHADOW_IMAGES
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene
from ssgi_cl.techniques.direct.shadow_blocks import BLOCK, ShadowBlocks

Doubles = NDArray[np.float64]
SIZE = 29
"""Texels along a side: the last block has 5."""
SPAN = BLOCK + 3
"""Texels from a block's first one that its taps may read."""


def measured(depth: NDArray[np.float32], perspective: bool) -> Doubles:
    """Return what is linear along a plane: 1 / depth, or minus an orthographic one."""
    with np.errstate(divide="ignore"):
        return 1.0 / depth.astype(np.float64) if perspective else -depth.astype(np.float64)


def found(runtime: Runtime, depth: NDArray[np.float32], perspective: bool) -> Doubles:
    """Return [faces, SHADOW_IMAGES, rows, columns] of the blocks of [faces, SIZE, SIZE] depths."""
    blocks = ShadowBlocks(runtime, SIZE)
    plane = runtime.plane(len(depth), (SIZE, SIZE))
    plane.upload(depth)
    result = blocks.plane(len(depth))
    blocks.find(plane, result, range(plane.count), perspective=perspective)
    return result.download().reshape(len(depth), SHADOW_IMAGES, *blocks.size).astype(np.float64)


def offsets(u: Doubles, block: Doubles, row: int, column: int) -> Doubles:
    """Return by how much the texels of a block's span lie above its plane through its corner."""
    part = u[BLOCK * row :, BLOCK * column :][:SPAN, :SPAN]
    y, x = np.indices(part.shape)
    result: Doubles = part - block[2] * x - block[3] * y
    return result


def slopes(u: Doubles, row: int, column: int) -> list[float]:
    """Return the lesser slope of both halves of a block's span, along rows and along columns."""
    part = u[BLOCK * row :, BLOCK * column :][:SPAN, :SPAN]
    found = []
    for line in (part[(len(part) - 1) // 2], part[:, (part.shape[1] - 1) // 2]):
        half = (len(line) - 1) // 2
        found.append(min(np.diff(line[: 2 * half + 1 : half]) / half, key=abs))
    return found


@pytest.mark.parametrize("perspective", [True, False])
def test_blocks_of_a_plane_have_its_slopes(variant_runtime: Runtime, perspective: bool) -> None:
    rows, columns = np.indices((SIZE, SIZE))
    u = np.stack([2.0 + 0.03 * columns - 0.01 * rows, 3.0 - 0.02 * columns + 0.04 * rows])
    depth = (1.0 / u if perspective else 5.0 - u).astype(np.float32)
    highest, lowest, b, c = np.moveaxis(found(variant_runtime, depth, perspective), 1, 0)
    wanted = np.ones_like(b)
    # Roundings of u, some 4, over the 2 texels at least from which a slope is taken.
    np.testing.assert_allclose(b, wanted * [[[0.03]], [[-0.02]]], atol=1e-6)
    np.testing.assert_allclose(c, wanted * [[[-0.01]], [[0.04]]], atol=1e-6)
    assert (highest >= lowest).all()
    assert (highest - lowest).max() < 2e-5


@pytest.mark.parametrize("perspective", [True, False])
def test_all_texels_of_a_block_lie_between_its_planes(
    variant_runtime: Runtime, rng: np.random.Generator, perspective: bool
) -> None:
    depth = rng.uniform(1.0, 4.0, (2, SIZE, SIZE)).astype(np.float32)
    depth[1, :, 12:] = np.inf
    blocks = found(variant_runtime, depth, perspective)
    for face, row, column in np.ndindex(2, *blocks.shape[2:]):
        block = blocks[face, :, row, column]
        if not face:
            np.testing.assert_allclose(block[2:], slopes(measured(depth[0], perspective), row, column), atol=1e-5)
        off = offsets(measured(depth[face], perspective), block, row, column)
        assert block[0] == pytest.approx(off.max(), abs=1e-5)
        assert block[1] == pytest.approx(off.min(), abs=1e-5)


@pytest.mark.parametrize("kind", ["spot", "directional"])
def test_frames_with_blocks_have_the_bits_of_those_without(runtime: Runtime, kind: str) -> None:
    """Maps that are kept while the camera moves have blocks, which prove texels lit or dark."""
    view = make_scene("street-7")
    low, high = view.scene.bounds
    above = 0.5 * (low + high) + (high - low) * (0.1, 0.6, 0.1)
    light: gi.Light = (
        gi.SpotLight(above, (0.3, -1.0, 0.1), 1.2, 50.0)
        if kind == "spot"
        else gi.DirectionalLight((0.9, -0.35, 0.2), 3.0)
    )

    def last(skips: bool, frames: int) -> NDArray[np.float32]:
        for step in range(4 - frames, 4):
            eye = np.add(view.eye, (0.01 * step, 0.0, 0.0))
            camera = gi.Camera.look_at(eye, view.target, view.up, yfov=view.yfov, width=80, height=60)
            frame = gi.render(
                view.scene,
                camera,
                [light],
                bounces=0,
                ao=False,
                shadow_size=128,
                skips=skips,
                outputs=("radiance",),
                exposure=1.0,
                runtime=runtime,
            )
        return frame.radiance

    plain = last(skips=False, frames=1)
    assert (plain > 0.0).any()
    np.testing.assert_array_equal(last(skips=True, frames=4), plain)
