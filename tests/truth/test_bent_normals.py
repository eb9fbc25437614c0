"""World truth of bent normals: a plane, a wall by quadrature, and what it is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.truth import bent_normals

from ..closed_forms import FLOOR, WALL, above, quads

pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")


def spot(distance: float) -> GBuffer:
    """Return what a camera sees of a spot of the floor, at a distance from the plane x = 0."""
    camera = above(distance, size=16)
    normal = np.tile(np.float32((0.0, 1.0, 0.0)), (*camera.size, 1))
    return GBuffer(camera=camera, depth=np.full(camera.size, 0.01, np.float32), normal=normal)


def angle(found: NDArray[np.float32], wanted: NDArray[np.float64]) -> float:
    """Return the angle between the mean of directions and another one, degrees."""
    mean = found.mean(axis=(0, 1))
    return float(np.degrees(np.arccos(mean @ wanted / np.linalg.norm(mean))))


def test_plane_bends_nothing() -> None:
    truth = bent_normals(quads(FLOOR), spot(0.5), 0.8, 256)
    np.testing.assert_allclose(np.linalg.norm(truth.mean, axis=-1), 1.0, rtol=0, atol=1e-6)
    # Rays are well spread: the mean of 256 is off by .005 in each pixel, of 256 pixels by less.
    assert angle(truth.mean, np.array([0.0, 1.0, 0.0])) < 0.1
    off = np.sqrt(np.mean((truth.mean - (0.0, 1.0, 0.0)) ** 2))
    assert off < 2.0 * np.sqrt(np.mean(truth.error**2)) < 0.03


@pytest.mark.parametrize("distance", [0.2, 0.5])
def test_floor_by_a_wall_bends_as_a_quadrature_says(distance: float) -> None:
    truth = bent_normals(quads(FLOOR, WALL), spot(distance), 0.8, 256)
    u, v = np.meshgrid((np.arange(400) + 0.5) / 400, (np.arange(400) + 0.5) / 400)
    way = np.stack([np.sqrt(u) * np.cos(2 * np.pi * v), np.sqrt(1 - u), np.sqrt(u) * np.sin(2 * np.pi * v)], axis=-1)
    wanted = way[0.8 * way[..., 0] > -distance].sum(axis=0)  # what misses x = 0 within .8
    wanted /= np.linalg.norm(wanted)
    assert np.degrees(np.arccos(wanted[1])) > 5.0
    # 65536 rays in all; rays start up to 2e-5 above the floor.
    assert angle(truth.mean, wanted) < 0.2


def test_another_pass_of_rays_is_kept_and_taken_again(tmp_path: Path) -> None:
    first = bent_normals(quads(FLOOR, WALL), spot(0.3), 0.8, 16)
    assert [path.name[:5] for path in (tmp_path / "truth").iterdir()] == ["bent-"]
    again = bent_normals(quads(FLOOR, WALL), spot(0.3), 0.8, 16)
    np.testing.assert_array_equal(first.mean, again.mean)
    assert first.key == again.key
    assert bent_normals(quads(FLOOR, WALL), spot(0.3), 0.7, 16).key != first.key


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(ValueError, match=r"radius is 0: expected a number > 0 \(scene units\)"):
        bent_normals(quads(FLOOR), spot(0.3), 0)
    with pytest.raises(ValueError, match="rays is 0: expected an integer >= 1"):
        bent_normals(quads(FLOOR), spot(0.3), 0.5, 0)
