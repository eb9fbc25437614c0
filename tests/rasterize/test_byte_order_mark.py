"""Texts of scenes may begin with a byte order mark, as editors write it."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import pytest

from ssgi_cl.rasterize.files.load import load_scene

from .loading import Gltf, written


@pytest.mark.parametrize("name", ["a.obj", "a.ply", "a.gltf"])
def test_a_byte_order_mark_is_no_part_of_a_text(tmp_path: Path, name: str) -> None:
    made = Gltf()
    made.triangle()
    made.json["buffers"] = [
        {"byteLength": len(made.binary), "uri": "data:;base64," + base64.b64encode(made.binary).decode()}
    ]
    texts = {
        "a.obj": "mtllib red.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        "a.ply": "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
        "a.gltf": json.dumps(made.json),
    }
    written(tmp_path, "red.mtl", "\ufeffnewmtl red\nKd 1 0 0\n")
    scene = load_scene(written(tmp_path, name, "\ufeff" + texts[name]))
    assert len(scene.triangles) == 1
    if name == "a.obj":
        assert scene.materials[0].albedo == (1.0, 0.0, 0.0)
