"""A G-buffer in float64 as kernels see it: view-space positions, normals that face the eye."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer

Doubles = NDArray[np.float64]
Kind = TypeVar("Kind", bound=np.generic)


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceView:
    """The pixels of a G-buffer, margin included, or every step-th of them.

    Attributes:
        camera: of the full-size image.
        depth: [rows, columns] scene units; +inf where nothing is.
        normal: [rows, columns, 3] view space, unit length, facing the viewer; 0 where nothing is.
        size: (rows, columns) of the result.
        margin: (rows, columns) by which the arrays exceed it on every side.
        step: pixels of the camera's image from one pixel here to the next.
        origin: (row, column) of the camera's image that array element (0, 0) was taken from.
        exact: see `GBuffer.exact`.
    """

    camera: Camera
    depth: Doubles
    normal: Doubles
    size: tuple[int, int]
    margin: tuple[int, int]
    step: int = 1
    origin: tuple[int, int]
    exact: bool = False

    @classmethod
    def of(cls, gbuffer: GBuffer) -> Self:
        """Return the front layer of a G-buffer, normals reconstructed where none are given."""
        depth = gbuffer.first("depth")
        assert depth is not None  # noqa: S101  every G-buffer has a depth
        view = cls(
            camera=gbuffer.camera,
            depth=depth.astype(np.float64),
            normal=np.zeros((*depth.shape, 3)),
            size=gbuffer.size,
            margin=gbuffer.margin,
            origin=(-gbuffer.margin[0], -gbuffer.margin[1]),
            exact=gbuffer.exact,
        )
        return replace(view, normal=view_normals(view, gbuffer.first("normal")))

    def reduced(self, step: int) -> SurfaceView:
        """Return every step-th pixel, beginning with the top left one of the inner image."""
        size = (-(-self.size[0] // step), -(-self.size[1] // step))
        margin = (self.margin[0] // step, self.margin[1] // step)
        first = tuple(self.margin[i] - margin[i] * step for i in (0, 1))
        rows, columns = (first[i] + step * np.arange(size[i] + 2 * margin[i]) for i in (0, 1))
        return SurfaceView(
            camera=self.camera,
            depth=self.depth[np.ix_(rows, columns)],
            normal=self.normal[np.ix_(rows, columns)],
            size=size,
            margin=margin,
            step=self.step * step,
            origin=(self.origin[0] + first[0], self.origin[1] + first[1]),
            exact=self.exact,
        )

    def inner(self, array: NDArray[Kind]) -> NDArray[Kind]:
        """Return `array` without the margin."""
        rows, columns = self.margin
        return array[rows : rows + self.size[0], columns : columns + self.size[1]]

    def slopes(self, row: Doubles, column: Doubles) -> tuple[Doubles, Doubles]:
        """Return x and y of the view ray at depth 1 (orthographic: at any depth).

        `row` and `column` count in the arrays, from their top left corner, centres at +0.5.
        """
        matrix = self.camera.projection
        image_column = (column - 0.5) * self.step + 0.5 + self.origin[1]
        image_row = (row - 0.5) * self.step + 0.5 + self.origin[0]
        ndc_x = 2.0 * image_column / self.camera.width - 1.0
        ndc_y = 1.0 - 2.0 * image_row / self.camera.height
        # ndc = (scale x + shift z + offset) / w with z = -depth, w = depth or 1.
        if self.camera.is_orthographic:
            return (ndc_x - matrix[0, 3]) / matrix[0, 0], (ndc_y - matrix[1, 3]) / matrix[1, 1]
        return (ndc_x + matrix[0, 2]) / matrix[0, 0], (ndc_y + matrix[1, 2]) / matrix[1, 1]

    def position(self, row: Doubles, column: Doubles, depth: Doubles) -> Doubles:
        """Return [..., 3] view-space positions of pixel positions at linear depths."""
        x, y = self.slopes(row, column)
        k = np.ones_like(depth) if self.camera.is_orthographic else depth
        return np.stack(np.broadcast_arrays(x * k, y * k, -depth), axis=-1)

    def positions(self) -> Doubles:
        """Return [rows, columns, 3] view-space positions of all pixel centres; 0 for nothing."""
        row, column = self.centres()
        return self.position(row, column, np.where(np.isfinite(self.depth), self.depth, 0.0))

    def in_scene(self, origin: Doubles) -> tuple[Doubles, Doubles, NDArray[np.bool_]]:
        """Return positions and normals [rows, columns, 3] of the inner image, axes of the world, relative to the
        origin of a scene; and where something is [rows, columns]."""
        turn = self.camera.view[:3, :3]
        position = self.inner(self.positions()) @ turn + (self.camera.position - origin)
        return position, self.inner(self.normal) @ turn, np.isfinite(self.inner(self.depth))

    def centres(self) -> tuple[Doubles, Doubles]:
        """Return row and column of every pixel centre, each [rows, columns]."""
        row, column = np.indices(self.depth.shape) + 0.5
        return row, column

    def pixel(self, position: Doubles) -> tuple[Doubles, Doubles]:
        """Return (row, column), not rounded, where view-space points [..., 3] are seen."""
        matrix = self.camera.projection
        clip = position @ matrix[:, :3].T + matrix[:, 3]
        image_column = (clip[..., 0] / clip[..., 3] + 1.0) * 0.5 * self.camera.width
        image_row = (1.0 - clip[..., 1] / clip[..., 3]) * 0.5 * self.camera.height
        return (
            (image_row - 0.5 - self.origin[0]) / self.step + 0.5,
            (image_column - 0.5 - self.origin[1]) / self.step + 0.5,
        )

    def pixels_per_unit(self, depth: Doubles) -> Doubles:
        """Return the pixels that a scene unit covers at a depth, the greater of both axes."""
        camera = self.camera
        focal = 0.5 * max(camera.width * camera.projection[0, 0], camera.height * camera.projection[1, 1])
        k = np.ones_like(depth) if camera.is_orthographic else depth
        result: Doubles = focal / self.step / k
        return result

    def flatness(self, depth: Doubles) -> Doubles:
        """Return the measure of depth that is linear in the pixel position on every plane."""
        return depth if self.camera.is_orthographic else 1.0 / depth


def view_normals(view: SurfaceView, world: NDArray[np.float32] | None) -> Doubles:
    """Return [rows, columns, 3] view-space unit normals that face the viewer.

    Args:
        view: whose depth counts; its normals do not.
        world: given normals, world space; 0 where the normal is to be reconstructed, None if
            everywhere.
    """
    rebuilt = _from_depth(view)
    there = np.isfinite(view.depth)[..., None]
    if world is None:
        return np.where(there, rebuilt, 0.0)
    given = world.astype(np.float64) @ view.camera.view[:3, :3].T
    position = view.positions()
    view_ray = position * [0.0, 0.0, 1.0] if view.camera.is_orthographic else position
    faces_away = np.sum(given * view_ray, axis=-1) > 0.0
    against_surface = np.sum(given * rebuilt, axis=-1) < 0.0
    given = np.where((faces_away & against_surface)[..., None], -given, given)
    is_given = np.any(world != 0.0, axis=-1)[..., None]
    return np.where(there, np.where(is_given, given, rebuilt), 0.0)


def _from_depth(view: SurfaceView) -> Doubles:
    """Cross product of the differences to the neighbours that differ less in depth.

    Where a pixel has neighbours in one direction alone, the other difference is that of one of
    these; without any, the surface is taken to lie across the view ray.
    """
    position = view.positions()
    there = np.isfinite(view.depth)
    row, column = view.centres()
    across = view.position(row, column + 1.0, -position[..., 2]) - position
    down = view.position(row + 1.0, column, -position[..., 2]) - position
    u, has_u = _smaller_difference(position, there, 1, across)
    v, has_v = _smaller_difference(position, there, 0, down)
    u = _borrowed(u, has_u, there, 0)
    v = _borrowed(v, has_v, there, 1)
    # v runs down the image and u right, so v x u points to the viewer.
    normal = np.cross(v, u)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    flat = length == 0.0
    return np.where(flat, [0.0, 0.0, 1.0], normal / np.where(flat, 1.0, length))


def _smaller_difference(
    position: Doubles, there: NDArray[np.bool_], axis: int, otherwise: Doubles
) -> tuple[Doubles, NDArray[np.bool_]]:
    """Of the differences to the next and to the previous pixel, the one smaller in depth.

    Returns it, and where there is one; elsewhere it is `otherwise`.
    """
    best = otherwise.copy()
    least = np.full(there.shape, np.inf)
    for ahead in (True, False):
        here = [slice(None), slice(None)]
        other = [slice(None), slice(None)]
        here[axis], other[axis] = (slice(None, -1), slice(1, None)) if ahead else (slice(1, None), slice(None, -1))
        a, b = tuple(here), tuple(other)
        difference = (position[b] - position[a]) * (1.0 if ahead else -1.0)
        change = np.abs(difference[..., 2])
        take = there[a] & there[b] & (change < least[a])
        best[a] = np.where(take[..., None], difference, best[a])
        least[a] = np.where(take, change, least[a])
    return best, np.isfinite(least)


def _borrowed(difference: Doubles, has: NDArray[np.bool_], there: NDArray[np.bool_], axis: int) -> Doubles:
    """Return differences with gaps filled by the next or previous pixel along `axis`."""
    result, open_ = difference.copy(), there & ~has
    for shift in (-1, 1):
        source, able = np.roll(difference, shift, axis), np.roll(has & there, shift, axis)
        edge = [slice(None), slice(None)]
        edge[axis] = slice(-1, None) if shift == -1 else slice(0, 1)
        able[tuple(edge)] = False
        take = open_ & able
        result = np.where(take[..., None], source, result)
        open_ = open_ & ~take
    return result
