"""Cameras that animations of glTF files move."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.errors import SceneError
from ssgi_cl.core.scene_camera import SceneCamera
from ssgi_cl.rasterize.files.gltf_animation import animated_cameras

from .loading import Gltf

PERSPECTIVE = {"type": "perspective", "perspective": {"yfov": 0.8, "znear": 0.1}}
QUARTER = [0.0, math.sin(math.pi / 4), 0.0, math.cos(math.pi / 4)]  # about +y
EXACT = {"rtol": 0, "atol": 1e-6}  # values of files are float32


class Shot(Gltf):
    """A file of a triangle, node 0, a parent, node 1, and its camera, node 2, called "eye"."""

    def __init__(self) -> None:
        super().__init__()
        self.triangle()
        self.json["scenes"] = [{"nodes": [0, 1]}]
        self.json["nodes"] += [{"children": [2]}, {"camera": 0, "name": "eye"}]
        self.json["cameras"] = [PERSPECTIVE]
        self.json["animations"] = [{"channels": [], "samplers": []}]

    def moves(self, node: int, path: str, times: Any, values: Any, **sampler: Any) -> None:
        own = self.json["animations"][0]
        sampler |= {"input": self.accessor(times, "f4"), "output": self.accessor(values, "f4")}
        own["samplers"].append(sampler)
        own["channels"].append({"sampler": len(own["samplers"]) - 1, "target": {"node": node, "path": path}})

    def cameras(self, folder: Path, fps: float = 4.0, name: str | None = None) -> list[SceneCamera]:
        path = folder / "a.glb"
        path.write_bytes(self.bytes())
        return animated_cameras(path, fps, name)


def eyes(cameras: list[SceneCamera]) -> np.ndarray[Any, Any]:
    """Return [frames, 3] where cameras stand."""
    return np.array([-each.view[:3, :3].T @ each.view[:3, 3] for each in cameras])


def test_a_camera_goes_straight_from_key_to_key(tmp_path: Path) -> None:
    shot = Shot()
    shot.moves(2, "translation", [0.5, 1.0, 2.0], [[0, 0, 0], [2, 0, 0], [2, 4, 0]])
    wanted = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 1, 0], [2, 2, 0], [2, 3, 0], [2, 4, 0]]
    np.testing.assert_allclose(eyes(shot.cameras(tmp_path)), wanted, **EXACT)


def test_steps_hold_and_splines_follow_their_tangents(tmp_path: Path) -> None:
    shot = Shot()
    shot.moves(2, "translation", [0.0, 1.0], [[0, 0, 0], [2, 0, 0]], interpolation="STEP")
    np.testing.assert_allclose(eyes(shot.cameras(tmp_path))[:, 0], [0, 0, 0, 0, 2], **EXACT)
    shot = Shot()
    # x(t) = t^2 between 0 and 2 s: slopes 0 and 4 a second.
    keys = [[0, 0, 0], [0, 0, 0], [0, 0, 0], [4, 0, 0], [4, 0, 0], [4, 0, 0]]
    shot.moves(2, "translation", [0.0, 2.0], keys, interpolation="CUBICSPLINE")
    np.testing.assert_allclose(eyes(shot.cameras(tmp_path))[:, 0], np.arange(0, 2.1, 0.25) ** 2, **EXACT)


def test_a_parent_that_turns_takes_its_camera_along_the_shorter_way(tmp_path: Path) -> None:
    shot = Shot()
    shot.json["nodes"][2]["translation"] = [0, 0, 3]
    shot.moves(1, "rotation", [0.0, 1.0], [[0, 0, 0, -1], QUARTER])  # the same turn as [0, 0, 0, 1]
    found = shot.cameras(tmp_path, fps=2)
    half = math.sqrt(0.5)
    np.testing.assert_allclose(eyes(found), [[0, 0, 3], [3 * half, 0, 3 * half], [3, 0, 0]], **EXACT)
    np.testing.assert_allclose(found[2].view[2, :3], [1, 0, 0], **EXACT)  # it looks at where it was turned about


def test_the_first_camera_that_moves_is_taken_and_others_by_name(tmp_path: Path) -> None:
    shot = Shot()
    shot.json["scenes"] = [{"nodes": [0, 1, 3, 4]}]
    shot.json["nodes"] += [{"camera": 0, "name": "still"}, {"camera": 0}]
    shot.moves(4, "translation", [0.0, 1.0], [[0, 0, 0], [1, 0, 0]])
    shot.moves(2, "translation", [0.0, 1.0], [[0, 0, 0], [0, 1, 0]])
    assert eyes(shot.cameras(tmp_path))[-1].tolist() == [0, 1, 0]
    assert eyes(shot.cameras(tmp_path, name="camera 4"))[-1].tolist() == [1, 0, 0]
    with pytest.raises(SceneError, match=r"moves no camera 'still'.*it has 'eye', 'camera 4'"):
        shot.cameras(tmp_path, name="still")


def test_a_file_in_which_no_camera_moves_says_so(tmp_path: Path) -> None:
    shot = Shot()
    shot.moves(0, "translation", [0.0, 1.0], [[0, 0, 0], [1, 0, 0]])
    with pytest.raises(SceneError, match="moves no camera: expected one that an animation moves"):
        shot.cameras(tmp_path)
    with pytest.raises(ValueError, match="fps is 0"):
        shot.cameras(tmp_path, fps=0)


@pytest.mark.parametrize(
    ("times", "values", "more", "message"),
    [
        ([0.0, 0.0], [[0, 0, 0]] * 2, {}, "times of the sampler of a channel of animation 0 do not increase"),
        ([-1.0, 0.0], [[0, 0, 0]] * 2, {}, "do not increase from 0 s on"),
        ([0.0, math.nan], [[0, 0, 0]] * 2, {}, "do not increase"),
        ([0.0, 1.0], [[0, 0, 0]] * 3, {}, "has 3 values: expected 2"),
        ([0.0, 1.0], [[0, 0, 0], [math.inf, 0, 0]], {}, "expected 2, all finite"),
        ([0.0, 1.0], [[0, 0, 0]] * 2, {"interpolation": "CUBICSPLINE"}, "has 2 values: expected 6"),
        ([0.0, 1.0], [[0, 0, 0]] * 2, {"interpolation": "SMOOTH"}, "is 'SMOOTH': expected LINEAR"),
        ([0.0, 1.0], [[0, 0, 0, 1]] * 2, {}, "expected VEC3"),
        ([0.0, 1e6], [[0, 0, 0]] * 2, {}, "expected at most 100000 frames"),
    ],
)
def test_wrong_samplers_are_named(tmp_path: Path, times: Any, values: Any, more: Any, message: str) -> None:
    shot = Shot()
    shot.moves(2, "translation", times, values, **more)
    with pytest.raises(SceneError, match=message):
        shot.cameras(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda json: json["animations"][0].pop("samplers"), "animation 0 has no list of samplers"),
        (lambda json: json["animations"][0].update(channels=[3]), "animation 0 has no list of channels"),
        (lambda json: json["animations"][0]["channels"][0].pop("target"), "has no target"),
        (lambda json: json["animations"][0]["channels"][0].update(sampler=7), "is 7: expected less than 1"),
        (lambda json: json["animations"][0]["channels"][0].update(sampler="a"), "expected a number of one"),
        (lambda json: json["animations"][0]["channels"][0]["target"].update(node=99), "is 99: expected less than 3"),
        (lambda json: json["animations"][0]["samplers"][0].update(input=-1), "is -1: expected less than"),
        (lambda json: json["nodes"][2].update(matrix=[1.0] * 16), "moves node 2, which has a matrix"),
        (lambda json: json["nodes"][2].update(scale=[0.0] * 3), "frame 1: camera 'eye' is left out"),
    ],
)
def test_wrong_animations_are_named(tmp_path: Path, change: Any, message: str) -> None:
    shot = Shot()
    shot.moves(2, "translation", [0.0, 1.0], [[0, 0, 0], [1, 0, 0]])
    change(shot.json)
    with pytest.raises(SceneError, match=message):
        shot.cameras(tmp_path)
