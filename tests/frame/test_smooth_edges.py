"""Frames with smooth edges: against pictures of more pixels, and what else they must leave as it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import EDGE_PLACES, FrameParams
from ssgi_cl.rasterize.scenes import make_scene

from .scenes import MAPS, cube, matt, scene_of

DIRECT: dict[str, Any] = {"bounces": 0, "ao": False, "outputs": ("radiance",), **MAPS}


def test_whole_pictures_have_smooth_edges_unless_told_otherwise() -> None:
    assert FrameParams().edge_places == EDGE_PLACES
    assert FrameParams(edges=0).edge_places == 0
    assert FrameParams(bounces=0).edge_places == 0
    assert FrameParams(indirect="ssdo", edges=5).edge_places == 5


@pytest.mark.parametrize(
    ("edges", "error", "told"),
    [
        (-1, ValueError, "edges is -1: expected an integer >= 0"),
        (65, ValueError, "edges is 65: expected an integer .*64"),
        (2.5, TypeError, "edges is 2.5: expected an integer"),
    ],
)
def test_bad_numbers_of_places(edges: Any, error: type[Exception], told: str) -> None:
    with pytest.raises(error, match=told):
        FrameParams(edges=edges)


@pytest.mark.parametrize("name", ["cornell_box", "workshop"])
def test_edges_approach_those_of_sixteen_times_the_pixels(runtime: Runtime, name: str) -> None:
    built = make_scene(name)
    lights = [*built.lights, gi.Environment((0.2, 0.3, 0.5))]
    plain, smooth = (
        gi.render(built.scene, built.camera(160, 120), lights, edges=edges, runtime=runtime, **DIRECT).radiance
        for edges in (0, 7)
    )
    fine = gi.render(built.scene, built.camera(640, 480), lights, runtime=runtime, **DIRECT).radiance
    exact = fine.reshape(120, 4, 160, 4, 3).mean(axis=(1, 3))
    changed = np.any(plain != smooth, axis=-1)
    assert 0.005 < changed.mean() < 0.7
    before, after = (np.abs(np.sqrt(found) - np.sqrt(exact))[changed].mean() for found in (plain, smooth))
    # Textures and shadows are those of pixel centres. Measured .29 in the box and .55 in the workshop.
    assert after < 0.7 * before


def test_no_output_but_the_picture_changes(runtime: Runtime) -> None:
    built = make_scene("cornell_box")
    given: dict[str, Any] = {"preset": "low", "runtime": runtime, "gbuffer": True, **MAPS}
    plain, smooth = (
        gi.render(built.scene, built.camera(64, 48), built.own_lights, edges=edges, **given) for edges in (0, 7)
    )
    assert "smooth edges" not in {stage.name for stage in plain.graph.stages}
    assert plain.gbuffer is not None
    assert smooth.gbuffer is not None
    for one, other in (
        (plain.gbuffer.depth, smooth.gbuffer.depth),
        (plain.gbuffer.normal, smooth.gbuffer.normal),
        (plain.indirect, smooth.indirect),
    ):
        assert one is not None
        np.testing.assert_array_equal(one, other)
    assert not np.array_equal(plain.radiance, smooth.radiance)


@pytest.mark.parametrize("column", [31.6, 32.0, 32.4])
def test_what_reaches_beyond_the_active_region_is_in_the_picture(runtime: Runtime, column: float) -> None:
    # A wall that ends within the column before or after a tile's side, on pixels or between their centres.
    camera = gi.Camera.orthographic((160, 40, 9), (160, 40, 0), view_height=80.0, width=320, height=80)
    points = [(0.0, 20.0, 0.0), (column, 20.0, 0.0), (column, 60.0, 0.0), (0.0, 60.0, 0.0)]
    wall = scene_of(points, [(0, 1, 2), (0, 2, 3)], matt(0.0, 2.0))
    lights = [gi.Environment((0.5, 0.5, 0.5))]
    frames = [
        gi.render(wall, camera, lights, exposure=1.0, skips=skips, edges=8, bounces=0, ao=False, runtime=runtime)
        for skips in (True, False)
    ]
    np.testing.assert_array_equal(frames[0].radiance, frames[1].radiance)
    np.testing.assert_array_equal(frames[0].image, frames[1].image)
    # Of 2 where the wall is and .5 of the sky, by the share of the pixel; 8 places tell eighths.
    expected = 0.5 + 1.5 * np.clip(column - np.arange(30, 34), 0.0, 1.0)
    np.testing.assert_allclose(frames[0].radiance[40, 30:34, 0], expected, atol=1.5 / 8)


@pytest.mark.parametrize("margin", [0.0, 0.2])
def test_margin_and_layers_change_no_edge(runtime: Runtime, margin: float) -> None:
    built = make_scene("cornell_box")
    given: dict[str, Any] = {**DIRECT, "edges": 7, "runtime": runtime}
    found = gi.render(built.scene, built.camera(61, 47), built.lights, overscan=margin, layers=2, **given)
    plain = gi.render(built.scene, built.camera(61, 47), built.lights, **given)
    # Shading rounds otherwise, to 2e-7 of 1; another pixel at an edge would be off by .01.
    np.testing.assert_allclose(found.radiance, plain.radiance, atol=1e-5)


def test_pictures_of_a_pixel_and_of_nothing(runtime: Runtime) -> None:
    camera = gi.Camera.look_at((0, 0, 0), (0, 0, -1), width=1, height=1)
    inside = gi.render(cube(0.0, 3.0), camera, [], edges=7, runtime=runtime, **DIRECT).radiance
    np.testing.assert_array_equal(inside, np.full((1, 1, 3), 3.0, np.float32))
    away = gi.Camera.look_at((0, 0, 5), (0, 0, 9), width=9, height=7)
    sky = gi.render(cube(0.0, 3.0), away, [gi.Environment((1, 2, 3))], edges=7, runtime=runtime, **DIRECT).radiance
    np.testing.assert_array_equal(sky, np.broadcast_to(np.float32((1, 2, 3)), (7, 9, 3)))
