"""A scene in device memory."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Any
from weakref import ref

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.closed_surfaces import closed_sides
from ssgi_cl.core.scene import WRAPS, Scene, Wrap
from ssgi_cl.core.srgb import BYTES
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.constants import START_BATCH, START_FEW
from ssgi_cl.device.runtime import Runtime

BOXED = START_BATCH
"""Triangles, one after the other, that share a box."""


class DeviceScene:
    """The arrays of a scene as the rasteriser's kernels read them; see kernels/raster/.

    Attributes:
        key: the scene's, see `Scene`.
        origin: [3] float64, the scene's.
        has_normals: whether every vertex has one.
        vertex_stride, triangle_stride: elements from one component to the next in planar arrays.
        shading: [vertices, 12] position, normal, texture coordinate and colour, and `faces`:
            [triangles, 4] vertices and material; see kernels/raster/records.clh.
        corners: 4 x [triangles, rounded up to 16] vertices, and whether the back is not there.
        boxes: [runs of `BOXED` triangles, 6] middle and half size of a box round them.
        few_boxes: [runs of `START_FEW` triangles, 6] likewise.
        spread: mean diagonal of the latter over that of the scene: small where triangles that
            follow each other lie together.
        lobes: [materials, 4] specular reflectance and exponent of the Phong lobe.
        through: [materials, 4] share of light that passes what is there, and whether it blends.
        textured, colored, emits, emits_textures, glossy, has_cutouts, culls: what the scene needs of the kernels.
    """

    def __init__(self, runtime: Runtime, scene: Scene) -> None:
        self.key = scene.key
        self.origin = scene.origin
        x, y, z = scene.normals.T  # numpy is slow on rows of three numbers
        self.has_normals = bool(((x != 0.0) | (y != 0.0) | (z != 0.0)).all())
        self.vertices = len(scene.positions)
        self.triangles = len(scene.triangles)
        self.vertex_stride = _rounded(self.vertices)
        self.triangle_stride = _rounded(self.triangles)
        self.positions = runtime.array(planar(scene.positions))
        self.uvs = runtime.array(planar(scene.uvs))
        self.corners = runtime.array(planar(np.column_stack([scene.triangles, scene.culled_backs])))
        # What is read for one triangle at a time lies together.
        none, (u, v) = np.zeros(self.vertices, np.float32), scene.uvs.T
        parts = [scene.positions, none, scene.normals, u, scene.colors, v]
        self.shading = runtime.array(np.column_stack(parts))
        self.faces = runtime.array(np.column_stack([scene.triangles, scene.material_ids]))
        boxes, few = triangle_boxes(scene.positions, scene.triangles, (BOXED, START_FEW))
        self.boxes, self.few_boxes, self._few = runtime.array(boxes), runtime.array(few), few
        extent = 0.5 * float(np.linalg.norm(np.ptp(scene.bounds, axis=0))) or 1.0
        self.spread = float(np.linalg.norm(few[:, 3:].astype(np.float64), axis=1).mean()) / extent
        materials = np.array(
            [
                [*m.albedo, m.texture, m.alpha, m.alpha_cutoff, *m.emission, *m.spread, m.emission_texture]
                for m in scene.materials
            ],
            np.float32,
        )
        self.materials = runtime.array(materials)
        self.lobes = runtime.array(np.array([[*m.specular, m.gloss] for m in scene.materials], np.float32))
        self.through = runtime.array(np.array([[*m.transmitted, m.blends] for m in scene.materials], np.float32))
        cutouts = cutouts_of(scene)
        self.cutouts = runtime.array(cutouts)
        table, texels = _mip_mapped(scene.textures, scene.wraps)
        self.textures = runtime.array(table)
        self.texels = runtime.array(texels.view("<i4"))
        self.decode = runtime.array(SRGB_TO_LINEAR)
        used = scene.used_materials
        self.textured = any(m.texture >= 0 for m in used)
        self.colored = bool((scene.colors != 1.0).any())
        self.emits = any(m.emits for m in used)
        self.emits_textures = scene.emits_by_texture
        self.glossy = any(m.is_glossy for m in used)
        self.has_cutouts = bool((cutouts >= 0).any())
        self.culls = scene.culls
        self._runtime, self._scene = runtime, ref(scene)  # it goes with the scene

    @cached_property
    def by_size(self) -> tuple[DeviceArray, DeviceArray]:
        """[runs] int32 numbers of the runs of `few_boxes`, those with large boxes first, and [runs, 6] these boxes."""
        order = np.argsort(-np.linalg.norm(self._few[:, 3:].astype(np.float64), axis=1), kind="stable")
        return self._runtime.array(order.astype(np.int32)), self._runtime.array(self._few[order])

    @cached_property
    def _sides(self) -> NDArray[np.int32]:
        scene = self._scene()
        assert scene is not None  # noqa: S101  who draws it has it
        return closed_sides(scene).astype(np.int32)

    @cached_property
    def closed(self) -> DeviceArray:
        """[triangles] int32: which side of a closed surface is the outer one, see `closed_sides`."""
        return self._runtime.array(self._sides)

    @property
    def has_solids(self) -> bool:
        """Whether any of its surfaces is closed."""
        return bool(self._sides.any())

    @cached_property
    def solid_share(self) -> float:
        """Share of its area that bounds solids."""
        scene = self._scene()
        assert scene is not None  # noqa: S101  who draws it has it
        a, b, c = (scene.positions[corner].astype(np.float64) for corner in scene.triangles.T)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        return float(area[self._sides != 0].sum() / max(float(area.sum()), 1e-300))


SRGB_TO_LINEAR = BYTES.astype(np.float32)
_LINEAR_TO_SRGB_STEPS = 4095
# Of each linear value in 1/4095, the byte whose linear value is nearest.
_LINEAR_TO_SRGB = np.searchsorted(
    (SRGB_TO_LINEAR[1:] + SRGB_TO_LINEAR[:-1]) / 2, np.linspace(0.0, 1.0, _LINEAR_TO_SRGB_STEPS + 1)
).astype(np.uint8)


def cutouts_of(scene: Scene) -> NDArray[np.int32]:
    """Return the material of each triangle with holes, -1 for others."""
    return np.where(scene.cut_out, scene.material_ids, -1).astype(np.int32)


def triangle_boxes(
    positions: NDArray[np.float32], triangles: NDArray[np.int32], counts: Iterable[int]
) -> list[NDArray[np.float32]]:
    """Return middle and half size of a box round each run of so many triangles, [runs, 6] each."""
    runs = [np.arange(0, len(triangles), count) for count in counts]
    found = [np.empty((len(firsts), 6), np.float32) for firsts in runs]
    corners = triangles.T.astype(np.intp, order="C")  # what is gathered lies in its order
    for axis, column in enumerate(positions.T):  # numpy is slow on rows of three numbers
        first, second, third = column[corners]
        low, high = np.minimum(np.minimum(first, second), third), np.maximum(np.maximum(first, second), third)
        for firsts, boxes in zip(runs, found, strict=True):
            least = np.minimum.reduceat(low, firsts).astype(np.float64)
            most = np.maximum.reduceat(high, firsts).astype(np.float64)
            boxes[:, axis], boxes[:, 3 + axis] = (least + most) / 2, (most - least) / 2
    return found


def _rounded(count: int) -> int:
    return (count + 15) // 16 * 16


def planar(rows: NDArray[Any]) -> NDArray[Any]:
    """Return [components, rounded count] of [count, components], the rest 0."""
    planar: NDArray[Any] = np.zeros((rows.shape[1], _rounded(len(rows))), rows.dtype)
    planar[:, : len(rows)] = rows.T
    return planar


def _mip_mapped(
    textures: tuple[NDArray[np.uint8], ...], wraps: tuple[Wrap, ...] | None = None
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Return the table of textures and all texels; see kernels/raster/texture.clh."""
    table, texels, offset = [], [], 0
    for texture, (across, down) in zip(textures, wraps or [("repeat", "repeat")] * len(textures), strict=True):
        levels = [texture]
        while max(levels[-1].shape[:2]) > 1:
            levels.append(_halved(levels[-1]))
        kinds = WRAPS.index(across) << 8 | WRAPS.index(down) << 12
        table.append([offset, texture.shape[1], texture.shape[0], len(levels) | kinds])
        texels += [level.reshape(-1, 4) for level in levels]
        offset += sum(level.shape[0] * level.shape[1] for level in levels)
    if not textures:
        return np.zeros((1, 4), np.int32), np.zeros((1, 4), np.uint8)
    return np.array(table, np.int32), np.concatenate(texels)


def _halved(texels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Average 2 x 2 texels in linear light; an odd last row or column is doubled."""
    rows, columns = texels.shape[:2]
    padded = np.pad(texels, ((0, rows % 2), (0, columns % 2), (0, 0)), mode="edge")
    half = np.empty(((rows + 1) // 2, (columns + 1) // 2, 4), np.uint8)
    for channel in range(4):  # one after the other: numpy is slow on every fourth byte
        own = np.ascontiguousarray(padded[..., channel])
        linear = SRGB_TO_LINEAR[own] if channel < 3 else own.astype(np.float32) / 255.0
        mean = linear[0::2, 0::2] + linear[1::2, 0::2] + linear[0::2, 1::2] + linear[1::2, 1::2]
        mean *= 0.25
        if channel < 3:
            steps = np.rint(mean * _LINEAR_TO_SRGB_STEPS).astype(np.int32)
            half[..., channel] = _LINEAR_TO_SRGB[steps]
        else:
            half[..., channel] = np.rint(mean * 255.0)
    return half
