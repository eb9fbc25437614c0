"""PLY files of polygons of several sizes, in text and in both byte orders."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.errors import SceneError
from ssgi_cl.core.scene import Scene
from ssgi_cl.rasterize.files.load import load_scene

from .loading import POSITION, ROUNDED, corners, written

POINTS = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0], [3, 0, 0], [3, 2, 0]]
FACES = [[0, 1, 2, 3, 4], [1, 5, 6], [1, 6, 2]]
"""A concave pentagon, and a square of two triangles beside it: an area of 2.5 + 2."""
RED = [255, 0, 128]
FORMATS = ("ascii", "binary_little_endian", "binary_big_endian")


def ply(form: str, *, uvs: bool = False) -> bytes:
    """Return a file whose faces have a colour before, and texture coordinates after, their list of vertices."""
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(form)
    head = ["ply", f"format {form} 1.0", f"element vertex {len(POINTS)}"]
    head += [f"property float {axis}" for axis in "xyz"] + [f"element face {len(FACES)}", "property uchar red"]
    head += ["property list uchar int vertex_indices", "property uchar green", "property uchar blue"]
    head += ["property list uchar float texcoord"] if uvs else []
    rows: list[tuple[str, list[Any]]] = [("3f", point) for point in POINTS]
    for number, face in enumerate(FACES):
        values = [RED[number], len(face), *face, 10, 20]
        kinds = f"BB{len(face)}iBB"
        if uvs:
            values += [2 * len(face), *(0.25 * POINTS[v][axis] for v in face for axis in (0, 1))]
            kinds += f"B{2 * len(face)}f"
        rows.append((kinds, values))
    if order is None:
        return "\n".join([*head, "end_header", *(" ".join(map(str, row)) for _, row in rows), ""]).encode()
    data = b"".join(struct.pack(order + kinds, *row) for kinds, row in rows)
    return "\n".join([*head, "end_header\n"]).encode() + data


def area(scene: Scene) -> float:
    a, b, c = np.moveaxis(corners(scene), 1, 0)
    return float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())


@pytest.mark.parametrize("form", FORMATS)
def test_polygons_become_triangles_with_their_colours(tmp_path: Path, form: str) -> None:
    scene = load_scene(written(tmp_path, "a.ply", ply(form)))
    assert len(scene.triangles) == 5
    assert area(scene) == pytest.approx(4.5)
    found = corners(scene)
    np.testing.assert_allclose(found[3], np.array(POINTS)[FACES[1]], **POSITION)
    linear = (np.array([0, 10, 20]) / 255.0 / 12.92, 1.0)
    first, second = scene.colors[scene.triangles[0, 0]], scene.colors[scene.triangles[3, 0]]
    np.testing.assert_allclose(first, [linear[1], linear[0][1], ((20 / 255 + 0.055) / 1.055) ** 2.4], **ROUNDED)
    np.testing.assert_allclose(second, [0.0, linear[0][1], ((20 / 255 + 0.055) / 1.055) ** 2.4], **ROUNDED)


@pytest.mark.parametrize("form", FORMATS)
def test_texture_coordinates_go_with_their_corners(tmp_path: Path, form: str) -> None:
    scene = load_scene(written(tmp_path, "a.ply", ply(form, uvs=True)))
    np.testing.assert_allclose(scene.uvs, 0.25 * (scene.positions + scene.origin)[:, :2], **POSITION)


@pytest.mark.parametrize("form", FORMATS)
def test_a_file_that_ends_within_a_polygon_is_refused(tmp_path: Path, form: str) -> None:
    with pytest.raises(SceneError, match="cut off or damaged"):
        load_scene(written(tmp_path, "a.ply", ply(form)[:-5]))


@pytest.mark.parametrize("vertex", ["7", "-1", "nan", "1e300"])
def test_a_vertex_that_is_not_there_is_named(tmp_path: Path, vertex: str) -> None:
    text = ply("ascii").replace(b"1 6 2 10 20", f"1 6 {vertex} 10 20".encode())
    with pytest.raises(SceneError, match=f"a face refers to vertex {float(vertex):.0f}, but there are 7"):
        load_scene(written(tmp_path, "a.ply", text))


@pytest.mark.parametrize("value", ["300", "-1", "nan"])
def test_a_value_beyond_its_type_is_named(tmp_path: Path, value: str) -> None:
    text = ply("ascii").replace(b"1 6 2 10 20", f"1 6 2 {value} 20".encode())
    with pytest.raises(SceneError, match=f"{value}.*expected 0 to 255"):
        load_scene(written(tmp_path, "a.ply", text))


@pytest.mark.filterwarnings("error")
def test_a_place_beyond_float32_is_refused(tmp_path: Path) -> None:
    text = ply("ascii").replace(b"0 0 0", b"1e300 0 0", 1)
    with pytest.raises((SceneError, ValueError), match=r"inf|finite"):
        load_scene(written(tmp_path, "a.ply", text))
