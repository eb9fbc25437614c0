"""Thickness of closed surfaces, as the rasteriser draws it."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize import gbuffer

from .meshes import quad, scene_of

SIZE = (90, 120)
EYE = (0.4, 0.7, 6.0)


def camera(kind: str) -> Camera:
    """Return a camera that looks down on what lies round the origin."""
    target = (0.05, 0.0, 0.0)
    if kind == "orthographic":
        return Camera.orthographic(EYE, target, view_height=3.0, width=SIZE[1], height=SIZE[0])
    return Camera.look_at(EYE, target, yfov=0.5, width=SIZE[1], height=SIZE[0])


def boxes(*placed: tuple[tuple[float, float, float], tuple[float, float, float]], inverted: bool = False) -> Scene:
    """Return boxes with these sizes and middles."""
    corners = []
    for extents, middle in placed:
        mesh = trimesh.creation.box(extents)
        corners.append(mesh.vertices[mesh.faces[:, ::-1] if inverted else mesh.faces].reshape(-1, 3) + middle)
    return scene_of(np.concatenate(corners))


def crossed(
    made: Camera, extents: tuple[float, float, float], middle: tuple[float, float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the depths [rows, columns] at which view rays enter and leave a box; nan where they miss it."""
    one, two = (made.unproject(np.full(SIZE, depth, np.float32)).astype(np.float64) for depth in (1.0, 2.0))
    way = two - one
    start = one - way
    with np.errstate(divide="ignore"):
        ends = [(np.array(middle) + side * 0.5 * np.array(extents) - start) / way for side in (-1.0, 1.0)]
    enters, leaves = np.minimum(*ends).max(axis=-1), np.maximum(*ends).min(axis=-1)
    return np.where(enters < leaves, enters, np.nan), np.where(enters < leaves, leaves, np.nan)


def drawn(scene: Scene, made: Camera, layers: int, runtime: Runtime) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return depth and thickness [layers, rows, columns]."""
    made_of: GBuffer = gbuffer(scene, made, layers=layers, thickness=True, runtime=runtime)
    depth, thickness = np.asarray(made_of.depth), np.asarray(made_of.thickness)
    return depth.reshape(layers, *SIZE), thickness.reshape(layers, *SIZE)


BOX = ((1.0, 0.6, 0.8), (0.1, 0.0, 0.2))


@pytest.mark.parametrize("inverted", [False, True])
@pytest.mark.parametrize("layers", [1, 2, 4])
@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_a_box_is_as_thick_as_view_rays_find_it(runtime: Runtime, kind: str, layers: int, inverted: bool) -> None:
    made = camera(kind)
    depth, thickness = drawn(boxes(BOX, inverted=inverted), made, layers, runtime)
    enters, leaves = crossed(made, *BOX)
    there = np.isfinite(depth[0]) & np.isfinite(enters)
    assert np.count_nonzero(there) > 300
    # At a silhouette the way is as short as the layers' least distance, 1e-5 of the depth.
    inside = there & (leaves - enters > 1e-3)
    np.testing.assert_allclose(thickness[0][inside], (leaves - enters)[inside], atol=2e-5)
    np.testing.assert_array_equal(thickness[0][~np.isfinite(depth[0])], -1.0)
    for deeper in range(1, layers):
        ends = np.isfinite(depth[deeper])
        np.testing.assert_array_equal(thickness[deeper], np.where(ends, 0.0, -1.0) if deeper == 1 else -1.0)


NESTED = (((2.0, 1.6, 0.6), (0.0, 0.0, 0.0)), ((0.8, 0.7, 2.0), (0.0, 0.0, -0.5)), ((0.6, 0.6, 0.4), (0.0, 0.0, -3.0)))
"""A slab, a bar through it that sticks out on either side, and a box behind both."""


def test_solids_end_where_they_are_left_and_not_at_the_first_inner_side(runtime: Runtime) -> None:
    made = camera("orthographic")
    depth, thickness = drawn(boxes(*NESTED), made, 8, runtime)
    slab, (front, end), (begin, back) = (crossed(made, *box) for box in NESTED)
    through = np.isfinite(slab[0]) & np.isfinite(end) & np.isfinite(begin)
    row, column = (int(axis[len(axis) // 2]) for axis in np.nonzero(through))
    assert np.isfinite(depth[:, row, column]).sum() == 6
    found = [float(value) for value in thickness[:, row, column]]
    assert found[0] == pytest.approx(end[row, column] - front[row, column], abs=2e-5)
    assert found[1] == pytest.approx(slab[1][row, column] - slab[0][row, column], abs=2e-5)
    assert found[2:4] == [0.0, 0.0]
    assert found[4] == pytest.approx(back[row, column] - begin[row, column], abs=2e-5)
    assert found[5:] == [0.0, -1.0, -1.0]


def test_a_sheet_has_no_known_thickness_and_is_no_back_of_what_lies_before(runtime: Runtime) -> None:
    made = camera("orthographic")
    sheet = quad([(-3, -3, -0.1), (-3, 3, -0.1), (3, 3, -0.1), (3, -3, -0.1)])  # its back to the camera, in the box
    box = boxes(BOX)
    both = scene_of(np.concatenate([box.positions, sheet.positions[sheet.triangles].reshape(-1, 3)]))
    enters, leaves = crossed(made, *BOX)
    for layers in (1, 4):
        depth, thickness = drawn(both, made, layers, runtime)
        inside = np.isfinite(enters) & (leaves - enters > 1e-3) & (np.abs(depth[0] - enters) < 1e-4)
        np.testing.assert_allclose(thickness[0][inside], (leaves - enters)[inside], atol=2e-5)
        np.testing.assert_array_equal(thickness[0][np.isnan(enters)], -1.0)


def test_other_arrays_keep_their_bits(runtime: Runtime) -> None:
    made = camera("perspective")
    for layers in (1, 3):
        with_it = gbuffer(boxes(*NESTED), made, layers=layers, thickness=True, runtime=runtime)
        without = gbuffer(boxes(*NESTED), made, layers=layers, runtime=runtime)
        assert without.thickness is None
        for name in ("depth", "normal", "albedo"):
            np.testing.assert_array_equal(getattr(with_it, name), getattr(without, name))


def test_opengl_backend_says_that_it_has_none() -> None:
    with pytest.raises(ValueError, match="thickness=True applies only to backend='opencl'"):
        gbuffer(boxes(BOX), camera("perspective"), thickness=True, backend="pyrender")
