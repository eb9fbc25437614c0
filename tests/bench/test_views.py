"""Scenes by name and by file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from ssgi_cl.core.errors import SceneError
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.tuning.measured_scenes import views_of


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "a ball.v2.ply"
    trimesh.creation.icosphere(subdivisions=2, radius=2.0).export(path)
    return path


def test_a_file_gets_a_name_that_fits_into_a_case_and_a_view_that_shows_it(ball: Path, runtime: Runtime) -> None:
    views = views_of(["cornell_box", str(ball)], runtime)
    assert list(views) == ["cornell_box", "a_ball_v2"]
    view = views["a_ball_v2"]
    camera = view.camera(80, 60)
    clip = camera.projection @ camera.view @ (0.0, 0.0, 0.0, 1.0)
    assert (np.abs(clip[:2]) < clip[3]).all()  # the ball's centre is inside the image
    assert view.lights
    # The ball fills 0.9 of the picture's height, 4 / 0.9 units at its distance and less before it;
    # the picture's diagonal is 5/3 of that. Its nearest point is a third nearer than its middle.
    assert 0.6 < view.ao_radius / (0.05 * 4.0 / 0.9 * 5.0 / 3.0) < 1.0


CAMERA = '"origin": [0, 0, 9], "forward": [0, 0, -1], "up": [0, 1, 0], "fov_deg": 60'


def test_a_view_names_its_mesh_its_camera_and_how_far_occlusion_reaches(ball: Path, runtime: Runtime) -> None:
    (ball.parent / "views").mkdir()
    for name, more in (("near", ', "ao_radius": 0.25'), ("far", "")):
        (ball.parent / "views" / f"{name}.json").write_text(f'{{"mesh": "../{ball.name}", {CAMERA}{more}}}')
    views = views_of([str(ball.parent / "views" / f"{n}.json") for n in ("near", "far")], runtime)
    assert list(views) == ["near", "far"]
    np.testing.assert_allclose(views["near"].eye, (0, 0, 9), atol=1e-12)
    np.testing.assert_allclose(views["near"].target, (0, 0, 8), atol=1e-12)
    assert len(views["near"].scene.triangles) == 320
    assert views["near"].ao_radius == 0.25
    ball.with_name("a ball.v2.scene.json").write_text(f"{{{CAMERA}}}")  # a camera beside the mesh
    np.testing.assert_allclose(views_of([str(ball)], runtime)["a_ball_v2"].eye, (0, 0, 9), atol=1e-12)
    # Meshes may lie in another folder than views.
    (moved := ball.parent / "views" / "moved.json").write_text(f'{{"mesh": "{ball.name}", {CAMERA}}}')
    assert len(views_of([str(moved)], runtime, ball.parent)["moved"].scene.triangles) == 320
    with pytest.raises(SceneError, match=r"views.*ball"):
        views_of([str(moved)], runtime)
    # From far away the ball is smaller than the picture: 5 % of the diagonal of a box 4 units wide
    # (an icosphere's box is that within 2 %).
    assert views["far"].ao_radius == pytest.approx(0.05 * 4.0 * 3.0**0.5, rel=0.02)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{{{CAMERA}}}", r"the view .*v\.json lacks mesh: expected the name of a mesh's file"),
        (f'{{{CAMERA}, "mesh": 3}}', "lacks mesh: expected the name"),
        (
            f'{{{CAMERA}, "mesh": "ball.ply", "ao_radius": 0}}',
            r"ao_radius in .*v\.json is 0: expected a number > 0 \(scene units\)",
        ),
        ('{"mesh": "ball.ply"}', r"v\.json lacks origin, forward, up, fov_deg"),
        ("{", r"v\.json is not JSON"),
    ],
)
def test_a_view_that_lacks_something_is_refused(text: str, message: str, tmp_path: Path, runtime: Runtime) -> None:
    (tmp_path / "v.json").write_text(text)
    with pytest.raises(ValueError, match=message):
        views_of([str(tmp_path / "v.json")], runtime)


def test_names_that_are_no_scene_are_refused(tmp_path: Path, runtime: Runtime) -> None:
    with pytest.raises(ValueError, match="scene is 'attic': expected a file or one of cornell_box"):
        views_of(["attic"], runtime)
    with pytest.raises(SceneError, match=r"attic\.obj"):
        views_of([str(tmp_path / "attic.obj")], runtime)
    with pytest.raises(ValueError, match="two scenes are called 'cornell_box'"):
        views_of(["cornell_box", "cornell_box"], runtime)
