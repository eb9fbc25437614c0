"""Structs that cross from the host to kernels."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.device.structs import Struct, camera_values, floats


def test_the_text_is_that_of_the_members() -> None:
    struct = Struct("Mixed", (*floats("a", "b"), ("n", "int")))
    assert struct.text == "typedef struct { float a; float b; int n; } Mixed;"
    assert struct.dtype == np.dtype([("a", "<f4"), ("b", "<f4"), ("n", "<i4")])


def test_a_missing_member_is_named() -> None:
    with pytest.raises(KeyError, match="b"):
        Struct("Two", floats("a", "b")).pack({"a": 1.0})


@pytest.mark.parametrize("margin", [(0, 0), (3, 5)])
def test_a_margin_shifts_the_camera_by_its_pixels(margin: tuple[int, int]) -> None:
    camera = Camera.from_intrinsics(50.0, 60.0, 30.0, 20.0, width=64, height=48)
    values, wider = camera_values(camera, margin), camera_values(camera.with_margin(margin))
    # The same numbers by two roads in float64; the largest is about 100.
    assert values == pytest.approx(wider, rel=1e-12)
    sx, sy, ox, oy = camera.pixel_to_view
    assert values["to_x"] * (10.5 + margin[1]) + values["at_x"] == pytest.approx(sx * 10.5 + ox)
    assert values["to_y"] * (20.5 + margin[0]) + values["at_y"] == pytest.approx(sy * 20.5 + oy)
    assert values["from_x"] * values["to_x"] == pytest.approx(1.0)
    assert values["perspective"] == 1.0
