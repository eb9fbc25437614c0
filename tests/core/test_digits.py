"""Places as text: distinct where they differ by a small part of what they belong to."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.digits import place_text
from ssgi_cl.core.scene import Scene


@pytest.mark.parametrize("far", [0.0, 1.0, 5e5, 5e6, 1e15])
@pytest.mark.parametrize("extent", [0.1, 1.0, 200.0])
def test_places_are_told_apart_to_a_thousandth_of_the_extent(far: float, extent: float) -> None:
    places = far + extent * np.array([0.0, 1e-3, 0.5, 0.999, 1.0])
    texts = place_text(places, extent).split()
    # Half a unit in the fourth digit of the extent, and float64's spacing at 1e15.
    np.testing.assert_allclose([float(text) for text in texts], places, rtol=0, atol=1e-3 * extent + 1.0 * (far > 1e14))
    if far < 1e14:
        assert len(set(texts)) == len(places), texts


def test_near_places_have_four_digits_and_no_tiny_numbers() -> None:
    assert place_text((0.123456, -0.0, 3e-9), 1.0) == "0.1235 0 0"
    assert place_text((1.0, 1.0), 0.0) == "1 1"


def test_texts_of_scenes_and_cameras_in_the_metres_of_a_map() -> None:
    corners = np.array([[0, 0, 0], [80, 0, 0], [0, 30, 10]], np.float32)
    scene = Scene(
        origin=np.array([500000.0, 120.0, 5000000.0]),
        positions=corners,
        normals=np.tile(np.float32([0, 1, 0]), (3, 1)),
        uvs=np.zeros((3, 2), np.float32),
        colors=np.ones((3, 3), np.float32),
        triangles=np.array([[0, 1, 2]], np.int32),
        material_ids=np.zeros(1, np.int32),
    )
    assert "(500000, 120, 5000000) to (500080, 150, 5000010)" in repr(scene)
    camera = Camera.look_at((500000.5, 120, 5000040), (500000, 120, 5000000), width=4, height=3)
    assert "at (500000.5, 120, 5000040)" in repr(camera)
