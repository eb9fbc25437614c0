"""Pictures rendered in bands of rows: near the whole picture, without a step where bands meet."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.core.errors import DeviceMemoryError
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame import bands
from ssgi_cl.rasterize.scenes import cornell_box

SIZE = 160, 320  # columns, rows


@pytest.fixture(scope="module")
def room() -> Any:
    return cornell_box()


@pytest.fixture(scope="module")
def whole(room: Any, runtime: Runtime) -> gi.Frame:
    return gi.render(room.scene, room.camera(*SIZE), room.lights, outputs=OUTPUTS, runtime=runtime)


OUTPUTS = ("image", "radiance", "ao", "indirect")


@pytest.fixture
def low(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bands, "_first_guess", lambda *_: 64)


def test_a_picture_in_bands_is_near_the_whole(room: Any, whole: gi.Frame, low: None, runtime: Runtime) -> None:
    banded = gi.render(
        room.scene, room.camera(*SIZE), room.lights, outputs=OUTPUTS, max_memory=1 << 33, runtime=runtime
    )
    # Each band chooses its virtual point lights: measured .014 of the mean (the frame's own error is ten times that).
    assert np.sqrt(np.mean((banded.radiance - whole.radiance) ** 2)) < 0.03 * whole.radiance.mean()
    assert banded.exposure == pytest.approx(whole.exposure, rel=0.01)
    assert banded.image.shape == whole.image.shape
    assert banded.ao is not None
    assert whole.ao is not None
    assert np.abs(banded.ao - whole.ao).mean() < 0.002  # edges where cropped cameras round otherwise
    assert banded.indirect is not None
    # No row differs from the one above by more than elsewhere: a step of the bands' difference would.
    step = np.abs(np.diff(banded.radiance, axis=0) - np.diff(whole.radiance, axis=0)).mean(axis=(1, 2))
    rows = np.arange(64, SIZE[1] - 64, 64)
    assert max(step[row - 1] for row in rows) < 0.003 * whole.radiance.mean()


def test_what_is_not_asked_for_is_not_there(room: Any, low: None, runtime: Runtime) -> None:
    camera = room.camera(*SIZE)
    frame = gi.render(room.scene, camera, room.lights, outputs=("ao",), max_memory=1 << 33, runtime=runtime)
    assert frame.ao is not None
    with pytest.raises(ValueError, match="radiance"):
        _ = frame.radiance
    picture = gi.render(room.scene, camera, room.lights, outputs=("image",), max_memory=1 << 33, runtime=runtime)
    assert picture.image.any()
    with pytest.raises(ValueError, match="radiance"):
        _ = picture.radiance


def test_a_radius_is_that_of_the_whole_view(room: Any, low: None, runtime: Runtime) -> None:
    camera = room.camera(*SIZE)
    given: dict[str, Any] = {"bounces": 0, "outputs": ("ao",), "runtime": runtime}
    whole = gi.render(room.scene, camera, room.lights, **given).ao
    banded = gi.render(room.scene, camera, room.lights, max_memory=1 << 33, **given).ao
    # GTAO of a band lacks what lies beyond the overlap of 64 rows.
    assert np.abs(banded - whole).mean() < 0.01


def test_wrong_arguments(room: Any, runtime: Runtime) -> None:
    camera = room.camera(*SIZE)
    with pytest.raises(ValueError, match="max_memory is 1073741824: expected no G-buffer in the frame"):
        gi.render(room.scene, camera, room.lights, gbuffer=True, max_memory=1 << 30, runtime=runtime)
    with pytest.raises(DeviceMemoryError, match="max_memory is 1048576"):
        gi.render(room.scene, camera, room.lights, max_memory=1 << 20, runtime=runtime)
    with pytest.raises(TypeError, match="camera is None"):
        gi.render(room.scene, None, room.lights, max_memory=1 << 30, runtime=runtime)  # type: ignore[arg-type]
