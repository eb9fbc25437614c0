"""Core glTF 2.0 that exporters rarely write: sparse accessors, zeros, fans, hidden nodes, skins."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.errors import SceneError

from .loading import POSITION, Gltf, corners

SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])


def square(made: Gltf, *, corners: Any = (0, 1, 2, 0, 2, 3)) -> dict[str, Any]:
    """Return the primitive of two triangles."""
    attributes = {"POSITION": made.accessor(SQUARE, "f4")}
    primitive: dict[str, Any] = {"attributes": attributes, "indices": made.accessor(corners, "u2")}
    made.json["meshes"][0]["primitives"].append(primitive)
    return primitive


def sparse(made: Gltf, rows: Any, values: Any) -> dict[str, Any]:
    return {
        "count": len(rows),
        "indices": {"bufferView": made.view(np.array(rows, "<u2").tobytes()), "componentType": 5123},
        "values": {"bufferView": made.view(np.array(values, "<f4").tobytes())},
    }


@pytest.mark.parametrize("base", [True, False])
def test_sparse_values_take_the_place_of_rows(tmp_path: Path, base: bool) -> None:
    made = Gltf()
    accessor = made.json["accessors"][square(made)["attributes"]["POSITION"]]
    rows, values = ([2], [[3.0, 3.0, 0.0]]) if base else ([1, 2, 3], SQUARE[1:])
    accessor["sparse"] = sparse(made, rows, values)
    if not base:
        del accessor["bufferView"]  # zeros, of which the first row stays
    expected = SQUARE.copy()
    expected[rows] = values
    np.testing.assert_allclose(corners(made.load(tmp_path)), expected[[[0, 1, 2], [0, 2, 3]]], **POSITION)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda a: a["sparse"]["indices"].update(componentType=5126), "component type 5126: expected unsigned"),
        (lambda a: a["sparse"].update(count=99), "the sparse part of accessor 0 reads 99 items"),
        (lambda a: a.update(count=2), "puts values in row 2: expected less than 2"),
        (lambda a: (a.pop("bufferView"), a.update(count=10**9)), "claims 1000000000 zeros: expected at most"),
    ],
)
def test_bad_sparse_accessors_are_refused(tmp_path: Path, change: Any, message: str) -> None:
    made = Gltf()
    accessor = made.json["accessors"][square(made)["attributes"]["POSITION"]]
    accessor["sparse"] = sparse(made, [2], [[3.0, 3.0, 0.0]])
    change(accessor)
    with pytest.raises(SceneError, match=message):
        made.load(tmp_path)


@pytest.mark.parametrize("indexed", [True, False])
def test_a_fan_turns_round_its_first_corner(tmp_path: Path, indexed: bool) -> None:
    made = Gltf()
    primitive = square(made, corners=(3, 0, 1, 2))
    primitive["mode"] = 6
    if not indexed:
        del primitive["indices"]
    order = SQUARE[[3, 0, 1, 2]] if indexed else SQUARE
    np.testing.assert_allclose(corners(made.load(tmp_path)), order[[[0, 1, 2], [0, 2, 3]]], **POSITION)


def test_what_hangs_on_a_hidden_node_is_not_there(tmp_path: Path) -> None:
    made = Gltf()
    square(made)
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}, "children": [2]}
    light = {"extensions": {"KHR_lights_punctual": {"light": 0}}, "mesh": 0}
    made.json["nodes"] += [hidden, light]
    made.json["scenes"][0]["nodes"].append(1)
    made.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    made.json["extensionsUsed"] = ["KHR_node_visibility", "KHR_lights_punctual"]
    scene = made.load(tmp_path)
    assert (len(scene.triangles), len(scene.lights), scene.notes) == (2, 0, ())
    hidden["extensions"]["KHR_node_visibility"]["visible"] = True
    scene = made.load(tmp_path)
    assert (len(scene.triangles), len(scene.lights)) == (4, 1)


def skinned(made: Gltf, weights: Any, joints: Any) -> None:
    """Put a square on two joints: one moved up by 10, the other turned by a quarter round z and moved by x = 5."""
    attributes = square(made)["attributes"]
    attributes |= {"JOINTS_0": made.accessor(joints, "u1"), "WEIGHTS_0": made.accessor(weights, "f4")}
    bind = np.tile(np.eye(4, dtype="<f4"), (2, 1, 1))
    bind[1, 3, :3] = -1.0, 0.0, 0.0  # column-major: the second joint was modelled at x = 1
    view = made.view(bind.tobytes())
    made.json["accessors"].append({"type": "MAT4", "componentType": 5126, "count": 2, "bufferView": view})
    made.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": len(made.json["accessors"]) - 1}]
    made.json["nodes"][0] |= {"skin": 0, "scale": [0.01, 0.01, 0.01]}  # which does not count
    half = 0.5**0.5
    turned = {"translation": [5.0, 0.0, 0.0], "rotation": [0.0, 0.0, half, half]}
    made.json["nodes"] += [{"translation": [0.0, 10.0, 0.0]}, turned]
    made.json["scenes"][0]["nodes"] += [1, 2]


def test_joints_place_a_skinned_mesh(tmp_path: Path) -> None:
    made = Gltf()
    weights = np.array([[1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0.75, 0.25, 0, 0]])
    skinned(made, weights, np.tile([0, 1, 0, 0], (4, 1)))
    first = SQUARE + np.array([0.0, 10.0, 0.0])
    x, y = SQUARE[:, 0] - 1.0, SQUARE[:, 1]
    second = np.stack([5.0 - y, x, 0.0 * x], axis=1)
    expected = weights[:, :1] * first + weights[:, 1:2] * second
    np.testing.assert_allclose(corners(made.load(tmp_path)), expected[[[0, 1, 2], [0, 2, 3]]], **POSITION)


def test_a_joint_that_is_not_there_is_refused(tmp_path: Path) -> None:
    made = Gltf()
    skinned(made, np.tile([1.0, 0, 0, 0], (4, 1)), np.tile([7, 0, 0, 0], (4, 1)))
    with pytest.raises(SceneError, match="names the joint 7: its skin has 2 joints"):
        made.load(tmp_path)
    made = Gltf()
    skinned(made, np.tile([1.0, 0, 0, 0], (4, 1)), np.zeros((4, 4)))
    made.json["scenes"][0]["nodes"].remove(2)
    with pytest.raises(SceneError, match="skin 0 has the joint 2, which is no node of the scene"):
        made.load(tmp_path)
