"""Skins of glTF: meshes that joints place, in the pose in which the nodes stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import SceneError
from ssgi_cl.rasterize.files.gltf_accessors import Accessors
from ssgi_cl.rasterize.files.gltf_document import item
from ssgi_cl.rasterize.files.gltf_schema import Json
from ssgi_cl.rasterize.parts import Part

Matrices = NDArray[np.float64]


def joint_matrices(document: Json, number: int, placed: Mapping[int, Matrices], accessors: Accessors) -> Matrices:
    """Return [joints, 4, 4], from the mesh's coordinates to world space by each joint (glTF 2.0, 3.7.3.3).

    Args:
        document: the checked JSON.
        number: of the skin.
        placed: matrix to world space of each node of the scene.
        accessors: of the document.

    Raises:
        SceneError: there is no such skin, a joint is not in the scene, or matrices are missing.
    """
    skin = item(document.get("skins", []), number, "the skin of a node")
    joints = skin["joints"]
    for joint in joints:
        if joint not in placed:
            raise SceneError(f"skin {number} has the joint {joint}, which is no node of the scene")
    world = np.array([placed[joint] for joint in joints]).reshape(-1, 4, 4)
    if "inverseBindMatrices" not in skin:
        return world
    bind = accessors.floats(skin["inverseBindMatrices"], ("MAT4",)).reshape(-1, 4, 4).transpose(0, 2, 1)
    if len(bind) < len(joints):
        raise SceneError(f"skin {number} has {len(bind)} matrices: expected one for each of {len(joints)} joints")
    matrices: Matrices = world @ bind[: len(joints)]
    return matrices


def posed(part: Part, matrices: Matrices, joints: NDArray[np.int64], weights: Matrices) -> Part:
    """Return a part in world space, each vertex moved by the mean of its joints' matrices.

    Args:
        part: in the mesh's coordinates.
        matrices: of `joint_matrices`.
        joints, weights: [vertices, 4].

    Raises:
        SceneError: a vertex names a joint that the skin has not.
    """
    used = weights != 0.0
    if used.any() and int(joints[used].max()) >= len(matrices):
        raise SceneError(f"{part.name} names the joint {int(joints[used].max())}: its skin has {len(matrices)} joints")
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        shares = weights / weights.sum(axis=1, keepdims=True)
        moved = np.einsum("vj,vjab->vab", shares, matrices[np.where(used, joints, 0)])
        positions = np.einsum("vab,vb->va", moved[:, :3, :3], part.positions) + moved[:, :3, 3]
        normals = part.normals
        if normals is not None:
            x, y, z = (moved[:, row, :3] for row in range(3))
            cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
            normals = np.einsum("vab,vb->va", cofactors, normals)
    return replace(part, positions=positions, normals=normals)
