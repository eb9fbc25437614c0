"""A frame is saved whole, and says in a few lines what it is; so do scenes, cameras and G-buffers."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.io.previews import GAP, MOST_ACROSS, gbuffer_views
from ssgi_cl.rasterize.scenes import cornell_box

MOST_LINES = 12


@pytest.fixture(scope="module")
def frame(runtime: Runtime) -> gi.Frame:
    room = cornell_box()
    lights = [*room.lights, gi.Environment(0.5)]  # whose light occlusion dims
    return gi.render(room.scene, room.camera(40, 30), lights, bounces=0, gbuffer=True, runtime=runtime)


def test_a_frame_is_saved_as_the_name_says(frame: gi.Frame, tmp_path: Path) -> None:
    frame.save(tmp_path / "a.png")
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "a.png")), frame.image)
    frame.save(tmp_path / "a.exr")
    found = exr.read(tmp_path / "a.exr")
    np.testing.assert_array_equal(np.stack([found[c] for c in "RGB"], axis=-1), frame.radiance)
    np.testing.assert_array_equal(found["ao"], frame.ao)
    np.testing.assert_array_equal(found["Z"], frame.arrays()["depth"])
    with pytest.raises(ValueError, match=r"path is '.*a\.jpg': expected a name that ends in \.png or \.exr"):
        frame.save(tmp_path / "a.jpg")


def test_a_notebook_shows_the_picture(frame: gi.Frame) -> None:
    data = frame._repr_png_()
    assert data is not None
    assert data.startswith(b"\x89PNG")


def test_a_notebook_shows_a_gbuffer(frame: gi.Frame) -> None:
    gbuffer = frame.gbuffer
    assert gbuffer is not None
    shown = np.asarray(Image.open(io.BytesIO(gbuffer._repr_png_())))
    views = gbuffer_views(gbuffer)
    assert shown.shape == (30, 3 * 40 + 2 * GAP, 3)
    np.testing.assert_array_equal(shown[:, :40], np.repeat(views["depth"][..., None], 3, axis=-1))
    np.testing.assert_array_equal(shown[:, 40 + GAP : 80 + GAP], views["normal"])
    np.testing.assert_array_equal(shown[:, 80 + 2 * GAP :], views["albedo"])
    # A large one is made smaller, and depth alone is a picture too.
    camera = gi.Camera.look_at((0, 0, 1), (0, 0, 0), width=2 * MOST_ACROSS + 10, height=20)
    far = np.full((20, camera.width), np.inf, np.float32)
    small = np.asarray(Image.open(io.BytesIO(gi.GBuffer(camera=camera, depth=far)._repr_png_())))
    assert small.shape == (7, (camera.width + 2) // 3, 3)
    assert not small.any()


def test_texts_are_short_and_say_what_there_is(frame: gi.Frame) -> None:
    room = cornell_box()
    texts = {
        repr(frame): ("image, radiance, ao, gbuffer", "passes"),
        repr(frame.gbuffer): ("30 x 40 pixels", "normal, albedo"),
        repr(room.scene): ("triangles", "materials"),
        repr(room.camera(40, 30)): ("40 x 30 pixels", "degrees high"),
        repr(gi.Camera.orthographic((0, 0, 1), (0, 0, 0), view_height=2.0, width=4, height=3)): (
            "orthographic, 2 high",
        ),
        repr(gi.GBufferBatch([frame.gbuffer] * 3)): ("GBufferBatch of 3",),  # type: ignore[list-item]
    }
    for text, parts in texts.items():
        assert len(text.splitlines()) < MOST_LINES
        assert len(text) < 600
        for part in parts:
            assert part in text, text


def test_a_scene_without_camera_and_lights_gets_some(runtime: Runtime) -> None:
    scene = cornell_box().scene
    camera = gi.default_camera(scene, 40, 30, runtime=runtime)
    assert camera.size == (30, 40)
    lights = gi.default_lights(scene, camera, runtime)
    assert all(isinstance(light, gi.Light) for light in lights)


def test_one_light_stands_for_a_list(runtime: Runtime) -> None:
    room = cornell_box()
    camera, light = room.camera(16, 12), room.lights[0]
    one, listed = (
        gi.render(room.scene, camera, lights, bounces=0, ao=False, outputs=("image",), runtime=runtime).image
        for lights in (light, [light])
    )
    np.testing.assert_array_equal(one, listed)
