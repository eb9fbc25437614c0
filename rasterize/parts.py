"""Parts of a scene, which every reader and built-in scene makes, and their assembly to a Scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.errors import SceneError
from ssgi_cl.core.lights import Light
from ssgi_cl.core.scene import Material, Scene, Wrap
from ssgi_cl.core.scene_camera import SceneCamera

from .normals import DEFAULT_CREASE_ANGLE, crease_normals

MOST_TRIANGLES = 50_000_000
"""Triangles of a scene, instances included; a small file can ask for far more by instancing."""

_LARGEST_COORDINATE = 1e30
"""Scene units; products of two coordinates must stay within float32."""

_LEAST_AREA = 1e-12
"""Twice the area over the square of the longest edge, below which a triangle is a line."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """Triangles of one mesh.

    Attributes:
        name: for messages.
        positions: [vertices, 3] float64, scene units.
        triangles: [triangles, 3] indices of vertices, counter-clockwise seen from outside.
        material_ids: [triangles] indices of materials.
        normals: [vertices, 3] of any length, or None; a row that is zero or not finite stands for
            a normal that has to be computed.
        uvs: [vertices, 2], v = 0 at the bottom row, or None for (0, 0).
        colors: [vertices, 3] linear, or None for white.
    """

    name: str
    positions: NDArray[np.float64]
    triangles: NDArray[np.int64]
    material_ids: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None
    uvs: NDArray[np.float64] | None = None
    colors: NDArray[np.float64] | None = None

    def transformed(self, matrix: NDArray[np.float64]) -> Part:
        """Return the part moved by `matrix` [4, 4]; a mirroring matrix turns the winding round."""
        if not (np.abs(matrix) <= _LARGEST_COORDINATE).all():  # false for NaN as well
            raise SceneError(
                f"{self.name} is placed by a matrix of numbers that are not finite or beyond "
                f"{_LARGEST_COORDINATE:g}: {matrix.tolist()}"
            )
        turn = matrix[:3, :3]
        mirrored = np.linalg.det(turn) < 0
        normals = self.normals
        # What overflows is refused where a triangle uses it, or computed anew if it is a normal.
        with np.errstate(over="ignore", invalid="ignore"):
            positions = self.positions @ turn.T + matrix[:3, 3]
            if normals is not None:
                # The cofactors are the inverse transpose times the determinant: they exist even
                # where the inverse doesn't, and only the determinant's sign is left to put right.
                x, y, z = turn
                cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)])
                normals = normals @ (-cofactors if mirrored else cofactors).T
        return replace(
            self,
            positions=positions,
            normals=normals,
            triangles=self.triangles[:, ::-1] if mirrored else self.triangles,
        )

    def with_vertices(self, vertices: NDArray[np.int64]) -> Part:
        """Return the part with vertices [n] of its own in place of all; triangles stay as they are."""
        names = ("positions", "normals", "uvs", "colors")
        given = {name: values for name in names if (values := getattr(self, name)) is not None}
        return replace(self, **{name: values[vertices] for name, values in given.items()})

    def with_face_colors(self, colors: NDArray[np.float64]) -> Part:
        """Return the part with linear colours [triangles, 3] of its triangles, whose vertices are not shared."""
        corners = self.triangles.ravel()
        triangles = np.arange(len(corners)).reshape(-1, 3)
        return replace(self.with_vertices(corners), triangles=triangles, colors=np.repeat(colors, 3, axis=0))


@dataclass(frozen=True)
class Contents:
    """Contents of a file.

    Attributes:
        parts: with indices of `materials`.
        materials: in the order of those indices.
        lights, cameras, notes: as `Scene` has them.
    """

    parts: Sequence[Part]
    materials: Sequence[Material]
    lights: tuple[Light, ...] = ()
    cameras: Mapping[str, SceneCamera] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def check_triangles(count: int) -> None:
    """Raise SceneError if `count` triangles, instances included, are too many."""
    if count > MOST_TRIANGLES:
        raise SceneError(f"{count} triangles with all instances: at most {MOST_TRIANGLES} fit")


def assemble(
    parts: Sequence[Part],
    materials: Sequence[Material],
    textures: Sequence[NDArray[np.uint8]] = (),
    wraps: Sequence[Wrap] = (),
    *,
    crease_angle: float = DEFAULT_CREASE_ANGLE,
) -> Scene:
    """Join `parts` to one scene around the centre of its bounds.

    Triangles without area are dropped, normals that are missing are computed, vertices that no
    triangle uses are left out.

    Raises:
        SceneError: an index leaves its array, a vertex in use is not finite, nothing is left.
    """
    count = sum(len(part.triangles) for part in parts)
    check_triangles(count)
    done = [part for part in (complete(part, crease_angle) for part in parts) if len(part.triangles)]
    if not done:
        raise SceneError(f"no triangle to draw ({count} in the source, {count} of them without area)")
    starts = np.cumsum([0] + [len(part.positions) for part in done])
    positions = np.concatenate([part.positions for part in done])
    origin = 0.5 * (positions.min(axis=0) + positions.max(axis=0))
    return Scene(
        origin=origin,
        positions=(positions - origin).astype(np.float32),
        normals=np.concatenate([_rows(part.normals, part, 0.0, 3) for part in done]),
        uvs=np.concatenate([_rows(part.uvs, part, 0.0, 2) for part in done]),
        colors=np.concatenate([_rows(part.colors, part, 1.0, 3) for part in done]),
        triangles=np.concatenate([part.triangles + start for part, start in zip(done, starts, strict=False)]),
        material_ids=np.concatenate([part.material_ids for part in done]),
        materials=tuple(materials) or (Material(),),
        textures=tuple(textures),
        wraps=tuple(wraps),
    )


def complete(part: Part, crease_angle: float = DEFAULT_CREASE_ANGLE) -> Part:
    """Return `part` without flaws, with unit normals and only the vertices in use.

    What is placed many times is best completed once before it is `transformed`.

    Raises:
        SceneError: an index leaves its array, a vertex in use is not finite.
    """
    part = _without_flaws(part)
    return _with_normals(part, crease_angle) if len(part.triangles) else part


def _rows(values: NDArray[np.float64] | None, part: Part, otherwise: float, width: int) -> NDArray[np.float32]:
    if values is None:
        return np.full((len(part.positions), width), otherwise, dtype=np.float32)
    usable = np.abs(values) <= np.finfo(np.float32).max  # false for NaN as well
    if not usable.all():
        vertex = int(np.argwhere(~usable)[0, 0])
        raise SceneError(
            f"{part.name}: a vertex near {part.positions[vertex].tolist()} has the texture "
            f"coordinate or colour {values[vertex].tolist()}: expected finite numbers of float32"
        )
    return values.astype(np.float32)


def _without_flaws(part: Part) -> Part:
    """Return `part` without triangles of no area; raise for what can't be drawn."""
    triangles = part.triangles
    if len(triangles) == 0:
        return part
    outside = (triangles < 0) | (triangles >= len(part.positions))
    if outside.any():
        triangle, corner = (int(i) for i in np.argwhere(outside)[0])
        raise SceneError(
            f"{part.name}: triangle {triangle} refers to vertex {triangles[triangle, corner]}, "
            f"but there are {len(part.positions)}"
        )
    for name, values in (("normals", part.normals), ("uvs", part.uvs), ("colors", part.colors)):
        if values is not None and len(values) != len(part.positions):
            raise SceneError(f"{part.name}: {len(values)} {name} for {len(part.positions)} vertices")
    corners = part.positions[triangles]
    # A comparison with NaN is false, so that NaN is caught as well.
    usable = np.abs(corners) <= _LARGEST_COORDINATE
    if not usable.all():
        triangle, corner = (int(i) for i in np.argwhere(~usable)[0, :2])
        vertex = int(triangles[triangle, corner])
        raise SceneError(
            f"{part.name}: vertex {vertex} is at {part.positions[vertex].tolist()}: expected "
            f"finite numbers up to {_LARGEST_COORDINATE:g}"
        )
    edges = np.roll(corners, -1, axis=1) - corners
    doubled_area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest = np.einsum("tij,tij->ti", edges, edges).max(axis=1)
    keep = doubled_area > _LEAST_AREA * longest
    if keep.all():
        return part
    return replace(part, triangles=triangles[keep], material_ids=part.material_ids[keep])


def _with_normals(part: Part, crease_angle: float) -> Part:
    """Return `part` with unit normals everywhere and only the vertices in use."""
    triangles = part.triangles
    given = np.zeros((len(part.positions), 3)) if part.normals is None else part.normals
    with np.errstate(invalid="ignore", over="ignore"):
        lengths = np.linalg.norm(given, axis=1)
        missing = ~((lengths > 1e-30) & np.isfinite(lengths))
    lengths[missing] = 1.0
    at_corner = missing[triangles]
    if at_corner.any():
        computed, groups = crease_normals(part.positions, triangles, crease_angle)
        # A vertex is split where its corners fall into several groups.
        keys = triangles * (triangles.size + 1) + np.where(at_corner, groups + 1, 0)
        _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
        vertices = triangles.ravel()[first]
        from_file = given[vertices] / lengths[vertices, None]
        normals = np.where(missing[vertices, None], computed.reshape(-1, 3)[first], from_file)
    else:
        vertices, inverse = np.unique(triangles, return_inverse=True)
        normals = given[vertices] / lengths[vertices, None]
    return replace(part.with_vertices(vertices), normals=normals, triangles=inverse.reshape(-1, 3))
