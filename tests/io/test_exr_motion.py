"""Motion of OpenEXR files: by the names and conventions of programs, held to the previous depth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.motion import MOST_MOTION
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io.exr_motion import motion_channels
from ssgi_cl.rasterize import gbuffer
from ssgi_cl.rasterize.scenes import make_scene

SIZE = (60, 80)


@pytest.fixture(scope="module")
def pair(runtime: Runtime) -> tuple[GBuffer, GBuffer]:
    """Return a picture of a room with its motion, and the one before."""
    room = make_scene("parlour")
    now, before = (
        Camera.look_at(np.add(room.eye, step), room.target, yfov=0.9, width=SIZE[1], height=SIZE[0])
        for step in ((0.0, 0.0, 0.0), (0.15, 0.1, 0.05))
    )
    drawn = gbuffer(room.scene, now, previous_camera=before, runtime=runtime)
    return drawn, gbuffer(room.scene, before, runtime=runtime)


def write(path: Path, drawn: GBuffer, channels: dict[str, NDArray[Any]]) -> Path:
    """Write the depth of a G-buffer and further channels."""
    planes = {"Z": np.asarray(drawn.depth), **channels}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {k: np.ascontiguousarray(v, np.float32) for k, v in planes.items()}).write(str(path))
    return path


def channels_of(kind: str, drawn: GBuffer) -> dict[str, NDArray[Any]]:
    """Return the channels of a program, by what its documentation says of them."""
    motion = np.asarray(drawn.motion)
    across, down = motion[..., 0], motion[..., 1]
    if kind == "blender":  # X, Y: previous - current, y up; Z, W: current - next, unlike the former
        return {"Vector.X": across, "Vector.Y": -down, "Vector.Z": across * 0.0, "Vector.W": across * 0.0}
    if kind == "nuke":
        return {"forward.u": -across, "forward.v": down}
    if kind == "ndc":
        return {"MotionVector.R": across * 2 / SIZE[1], "MotionVector.G": -down * 2 / SIZE[0]}
    return {f"motion.{'XYZ'[i]}": motion[..., i] for i in range(3)}


@pytest.mark.parametrize("said", [False, True])
@pytest.mark.parametrize("kind", ["pixels", "blender", "nuke", "ndc"])
def test_motion_of_each_program_is_read_and_its_residual_reported(
    tmp_path: Path, pair: tuple[GBuffer, GBuffer], kind: str, said: bool
) -> None:
    drawn, previous = pair
    path = write(tmp_path / "shot.exr", drawn, channels_of(kind, drawn))
    given: dict[str, Any] = {"motion_kind": kind} if said else {}
    read = GBuffer.from_exr(path, camera=drawn.camera, previous=previous, **given)
    wanted = np.asarray(drawn.motion)[..., : 3 if kind == "pixels" else 2]
    # Stored in float32: of NDC, one rounding more.
    np.testing.assert_allclose(read.motion, wanted, rtol=0, atol=1e-5)
    note = next(note for note in read.notes if "motion is read as" in note)
    residual = read.motion_residual(previous)
    assert f"motion is read as {kind!r}: {residual}" in note
    assert residual.share > 0.8  # the rest: edges, and what was hidden
    np.testing.assert_array_equal(read.depth, drawn.depth)


def test_wrong_convention_is_refused_with_both_residuals(tmp_path: Path, pair: tuple[GBuffer, GBuffer]) -> None:
    drawn, previous = pair
    forward = channels_of("nuke", drawn)
    backward = {name: -plane for name, plane in forward.items()}  # as if to the previous image
    path = write(tmp_path / "shot.exr", drawn, backward)
    with pytest.raises(ValueError, match=r"shot.exr: motion from forward.u, forward.v: .*'nuke' does not fit .*'blend"):
        GBuffer.from_exr(path, camera=drawn.camera, previous=previous, motion_kind="nuke")
    found = GBuffer.from_exr(path, camera=drawn.camera, previous=previous)
    np.testing.assert_allclose(found.motion, np.asarray(drawn.motion)[..., :2], rtol=0, atol=1e-6)


def test_motion_is_read_when_asked_for_and_without_the_previous_image_the_note_says_so(
    tmp_path: Path, pair: tuple[GBuffer, GBuffer]
) -> None:
    drawn, _ = pair
    path = write(tmp_path / "shot.exr", drawn, channels_of("blender", drawn))
    assert GBuffer.from_exr(path, camera=drawn.camera).motion is None
    read = GBuffer.from_exr(path, camera=drawn.camera, motion_kind="blender")
    assert any("not verified without previous=" in note for note in read.notes)
    named = GBuffer.from_exr(
        path, camera=drawn.camera, motion_kind="blender", channels={"motion": ("Vector.X", "Vector.Y")}
    )
    by_stem = GBuffer.from_exr(path, camera=drawn.camera, motion_kind="blender", channels={"motion": "Vector"})
    np.testing.assert_array_equal(named.motion, read.motion)
    np.testing.assert_array_equal(by_stem.motion, read.motion)


@pytest.mark.parametrize("components", [2, 3])
def test_saved_motion_is_read_again(tmp_path: Path, pair: tuple[GBuffer, GBuffer], components: int) -> None:
    drawn, previous = pair
    motion = np.asarray(drawn.motion)[..., :components]
    GBuffer(camera=drawn.camera, depth=drawn.depth, motion=motion).save(tmp_path / "g.exr")
    read = GBuffer.from_exr(tmp_path / "g.exr", motion_kind="pixels", previous=previous)
    np.testing.assert_array_equal(read.motion, motion)


def test_bad_files_and_arguments_are_refused(tmp_path: Path, pair: tuple[GBuffer, GBuffer]) -> None:
    drawn, _ = pair
    camera = drawn.camera
    none = write(tmp_path / "none.exr", drawn, {})
    with pytest.raises(ValueError, match=r"none.exr: no channels of motion \(vector with .*out of Z"):
        GBuffer.from_exr(none, camera=camera, motion_kind="blender")
    broken = channels_of("blender", drawn)
    broken["Vector.X"] = broken["Vector.X"].copy()
    broken["Vector.X"][3, 4] = np.nan
    path = write(tmp_path / "nan.exr", drawn, broken)
    with pytest.raises(ValueError, match=r"channel 'Vector.X' is nan in row 3, column 4"):
        GBuffer.from_exr(path, camera=camera, motion_kind="blender")
    hole = GBuffer.from_exr(path, camera=camera, motion_kind="blender", nan="hole")
    assert np.asarray(hole.motion)[3, 4, 0] == MOST_MOTION
    with pytest.raises(ValueError, match=r"motion_kind is 'maya': expected one of 'pixels', 'blender'"):
        GBuffer.from_exr(path, camera=camera, motion_kind="maya")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"previous is str: expected a GBuffer"):
        GBuffer.from_exr(path, camera=camera, previous="before", nan="hole")  # type: ignore[arg-type]
    broken["Vector.X"][3, 4] = 1e9
    beyond = write(tmp_path / "beyond.exr", drawn, broken)
    with pytest.raises(ValueError, match=r"motion\[3, 4, 0\] is 1000000000.0: expected numbers .*px"):
        GBuffer.from_exr(beyond, camera=camera, motion_kind="blender")


def test_channels_are_found_by_layer_and_given_names() -> None:
    names = ["a.Vector.X", "a.Vector.Y", "b.Vector.X", "b.Vector.Y", "forward.u", "forward.v"]
    assert motion_channels(names, "blender", "b") == ("b.Vector.X", "b.Vector.Y")
    assert motion_channels(names, "nuke") == ("forward.u", "forward.v")
    assert motion_channels(names, None, None, "a.Vector") == ("a.Vector.X", "a.Vector.Y")
    with pytest.raises(ValueError, match=r"expected two or three of"):
        motion_channels(names, None, None, ("a.Vector.X",))
