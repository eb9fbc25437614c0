"""Scenes by name and by file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from ssgi_cl.bench.views import views_of
from ssgi_cl.errors import SceneError
from ssgi_cl.runtime import Runtime


@pytest.fixture
def ball(tmp_path: Path) -> Path:
    path = tmp_path / "a ball.v2.ply"
    trimesh.creation.icosphere(subdivisions=2, radius=2.0).export(path)
    return path


def test_a_file_gets_a_name_that_fits_into_a_case_and_a_view_that_shows_it(
    ball: Path, runtime: Runtime
) -> None:
    views = views_of(["cornell_box", str(ball)], runtime)
    assert list(views) == ["cornell_box", "a_ball_v2"]
    view = views["a_ball_v2"]
    camera = view.camera(80, 60)
    clip = camera.projection @ camera.view @ (0.0, 0.0, 0.0, 1.0)
    assert (np.abs(clip[:2]) < clip[3]).all()  # the ball's centre is inside the image
    assert view.lights
    # 5 % of the diagonal of a box 4 units wide (an icosphere's box is that within 2 %).
    assert view.ao_radius == pytest.approx(0.05 * 4.0 * 3.0**0.5, rel=0.02)


def test_a_camera_beside_the_file_is_taken(ball: Path, runtime: Runtime) -> None:
    ball.with_name("a ball.v2.scene.json").write_text(
        '{"origin": [0, 0, 9], "forward": [0, 0, -1], "up": [0, 1, 0], "fov_deg": 60}'
    )
    view = views_of([str(ball)], runtime)["a_ball_v2"]
    np.testing.assert_allclose(view.eye, (0, 0, 9), atol=1e-12)
    np.testing.assert_allclose(view.target, (0, 0, 8), atol=1e-12)


def test_names_that_are_no_scene_are_refused(tmp_path: Path, runtime: Runtime) -> None:
    with pytest.raises(ValueError, match="scene is 'attic': expected a file or one of cornell_box"):
        views_of(["attic"], runtime)
    with pytest.raises(SceneError, match=r"attic\.obj"):
        views_of([str(tmp_path / "attic.obj")], runtime)
    with pytest.raises(ValueError, match="two scenes are called 'hall'"):
        views_of(["hall", "hall"], runtime)
