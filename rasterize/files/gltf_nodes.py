"""The nodes of a glTF document: the place of each in the scene."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from trimesh import transformations

from ssgi_cl.core.errors import SceneError
from ssgi_cl.rasterize.files.gltf_document import item
from ssgi_cl.rasterize.files.gltf_schema import VISIBILITY, Json

_turned_by: Any = transformations.quaternion_matrix


def placed_nodes(document: Json) -> list[tuple[int, NDArray[np.float64]]]:
    """Return (number of a node, its matrix [4, 4] to world space) of each node.

    Those of the default scene; of all nodes where the document has no scene. A node that is not
    visible (KHR_node_visibility) and all below it are left out. Walked without recursion, so that
    depth costs nothing.

    Raises:
        SceneError: a number is out of range, or a node hangs in several places.
    """
    nodes = document.get("nodes", [])
    parents = np.zeros(len(nodes), dtype=np.int64)
    for node in nodes:
        for child in node.get("children", []):
            item(nodes, child, "a child of a node")
            parents[child] += 1
    if "scenes" in document:
        scene = item(document["scenes"], document.get("scene", 0), "the scene")
        roots = scene.get("nodes", [])
    else:
        roots = [int(i) for i in np.flatnonzero(parents == 0)]
    for root in roots:
        item(nodes, root, "a node of the scene")
        parents[root] += 1
    if (parents > 1).any():
        node = int(np.argmax(parents > 1))
        raise SceneError(f"node {node} hangs in several places: expected a tree of nodes")
    # A ring of nodes hangs on no root, or one of its nodes has two parents: this ends.
    placed = []
    waiting = [(root, np.eye(4)) for root in roots]
    while waiting:
        index, above = waiting.pop()
        node = nodes[index]
        if not node.get("extensions", {}).get(VISIBILITY, {}).get("visible", True):
            continue
        # Whatever overflows is refused where it is used, with the name of the mesh.
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = np.dot(above, _local(node))
        placed.append((index, matrix))
        waiting += [(child, matrix) for child in node.get("children", [])]
    return placed


def placed_meshes(
    document: Json, placed: list[tuple[int, NDArray[np.float64]]]
) -> list[tuple[int, NDArray[np.float64]]]:
    """Return (number of a node with a mesh, its matrix) of each placed one."""
    meshes = []
    for index, matrix in placed:
        node = document["nodes"][index]
        if "mesh" in node:
            item(document.get("meshes", []), node["mesh"], "the mesh of a node")
            meshes.append((index, matrix))
    return meshes


def _local(node: Json) -> NDArray[np.float64]:
    """Return [4, 4]: node to parent; translation after rotation after scale."""
    matrix = np.eye(4)
    if "matrix" in node:
        matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    if "translation" in node:
        moved = np.eye(4)
        moved[:3, 3] = node["translation"]
        matrix = np.dot(matrix, moved)
    if "rotation" in node:
        x, y, z, w = np.array(node["rotation"], dtype=np.float64)
        matrix = np.dot(matrix, np.asarray(_turned_by([w, x, y, z])))
    if "scale" in node:
        matrix = np.dot(matrix, np.diag([*np.array(node["scale"], dtype=np.float64), 1.0]))
    return matrix
