"""Cameras: a world-to-view matrix, a projection and a size in pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.digits import place_text
from ssgi_cl.core.immutable import Immutable, frozen

DepthRange = Literal["-1..1", "0..1"]
LARGEST_SIZE = 16384
"""Columns or rows of the largest image, in pixels (the rasteriser's fixed point allows it)."""

LEAST_SCALE, MOST_SCALE = 1e-28, 1e28
"""Heights of an orthographic view in scene units, and scales of a projection: float32 holds their
reciprocals divided by the size of an image in pixels."""

MOST_SHIFT = 1e9
"""Half images by which a projection may be off-centre."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Camera(Immutable):
    """A pinhole or orthographic camera, given by two matrices.

    View space is right-handed: +x right, +y up, the camera looks down -z. Pixel centres lie at
    +0.5 and row 0 is the top row. The matrices are read-only.

    Attributes:
        view: [4, 4] float64, world to view, a rigid motion (rotation and translation only).
        projection: [4, 4] float64, view to clip space. Perspective, orthographic and off-centre
            projections, reversed-Z and an infinite far plane are allowed; skew is not.
        width, height: pixels, 1 to 16384.
        depth_range: what the projection makes of the near and far plane: "-1..1" as in OpenGL,
            or "0..1" as in Direct3D, Vulkan and every reversed-Z set-up.
    """

    view: NDArray[np.float64]
    projection: NDArray[np.float64]
    width: int
    height: int
    depth_range: DepthRange = "-1..1"

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        for name in ("width", "height"):
            value = checks.integer(name, getattr(self, name), low=1, high=LARGEST_SIZE, unit="px")
            set_(self, name, value)
        checks.choice("depth_range", self.depth_range, ("-1..1", "0..1"))
        view = checks.matrix4("view", self.view)
        turn = view[:3, :3]
        rigid = np.allclose(turn @ turn.T, np.eye(3), atol=1e-5) and np.linalg.det(turn) > 0
        if not rigid or not np.array_equal(view[3], [0, 0, 0, 1]):
            raise ValueError(
                f"view is {view.tolist()}: expected a rotation and a translation without scale or "
                "mirroring, last row 0 0 0 1"
            )
        checks.point("translation of view", view[:3, 3])
        set_(self, "view", frozen(view))
        set_(self, "projection", frozen(self._normalised_projection()))
        near, far = self.near, self.far
        if not (near < far and (self.is_orthographic or near > 0)):
            raise ValueError(
                f"projection puts the near plane at {near:g} and the far plane at {far:g}: "
                f"expected 0 < near < far (depth_range is {self.depth_range!r}; reversed-Z "
                "needs '0..1')"
            )

    def __repr__(self) -> str:
        eye, ahead = (place_text(vector, 1.0, ", ") for vector in (self.position, -self.view[2, :3]))
        if self.is_orthographic:
            field = f"orthographic, {2.0 / self.projection[1, 1]:.4g} high"
        else:
            field = f"{math.degrees(2.0 * math.atan(1.0 / self.projection[1, 1])):.1f} degrees high"
        return f"Camera of {self.width} x {self.height} pixels at ({eye}), looking along ({ahead}), {field}"

    def _normalised_projection(self) -> NDArray[np.float64]:
        matrix: NDArray[np.float64] = checks.matrix4("projection", self.projection)
        last = matrix[3]
        if np.array_equal(last[:3], [0, 0, 0]) and last[3] > 0:
            matrix = matrix / last[3]
            unused = (matrix[0, 1], matrix[1, 0], matrix[0, 2], matrix[1, 2])
        elif np.array_equal(last[[0, 1, 3]], [0, 0, 0]) and last[2] < 0:
            matrix = matrix / -last[2]
            unused = (matrix[0, 1], matrix[1, 0], matrix[0, 3], matrix[1, 3])
        else:
            raise ValueError(
                f"projection's last row is {last.tolist()}: expected 0 0 -1 0 (perspective) or "
                "0 0 0 1 (orthographic); the camera looks down -z"
            )
        if any(unused) or matrix[2, 0] or matrix[2, 1]:
            raise ValueError(
                f"projection is {matrix.tolist()}: expected no skew, shear or rotation "
                "(x from x and z only, y from y and z only, depth from z only)"
            )
        if matrix[0, 0] <= 0 or matrix[1, 1] <= 0 or matrix[2, 2:].tolist() == [0.0, 0.0]:
            raise ValueError(
                f"projection's scales are {matrix[0, 0]:g} and {matrix[1, 1]:g}: expected both > 0 "
                "and a third row that depends on depth"
            )
        scales = np.diag(matrix)[:2]
        shifts = matrix[:2, 3 if matrix[3, 3] else 2]
        if (scales < LEAST_SCALE).any() or (scales > MOST_SCALE).any():
            raise ValueError(
                f"projection's scales are {scales[0]:g} and {scales[1]:g}: expected {LEAST_SCALE:g} to {MOST_SCALE:g}"
            )
        if (np.abs(shifts) > MOST_SHIFT).any():
            raise ValueError(
                f"projection shifts the image by {shifts[0]:g} and {shifts[1]:g} of half its size: "
                f"expected at most {MOST_SHIFT:g}"
            )
        return matrix

    @classmethod
    def look_at(
        cls,
        eye: ArrayLike,
        target: ArrayLike,
        up: ArrayLike = (0.0, 1.0, 0.0),
        *,
        yfov: float = 0.9,
        width: int,
        height: int,
        near: float | None = None,
        far: float = math.inf,
        reversed_z: bool = False,
    ) -> Self:
        """Make a perspective camera at `eye` that looks at `target`.

        Args:
            eye, target: [3], world space, scene units.
            up: [3], world space; must not be parallel to the view ray.
            yfov: vertical field of view in radians, in (0, pi).
            width, height: pixels.
            near: scene units; by default 1e-3 of the distance from `eye` to `target`.
            far: scene units; infinite by default.
            reversed_z: map near to 1 and far to 0, depth range "0..1".
        """
        view = look_at_matrix(eye, target, up)
        yfov = checks.number("yfov", yfov, low=1e-4, high=3.14, unit="radians")
        distance = float(np.linalg.norm(checks.vector("target", target, 3) - np.asarray(eye)))
        near = 1e-3 * distance if near is None else near
        fy = 1.0 / math.tan(0.5 * yfov)
        fx = fy * height / width if width else fy
        projection = perspective_matrix(fx, fy, 0.0, 0.0, near, far, reversed_z=reversed_z)
        depth_range: DepthRange = "0..1" if reversed_z else "-1..1"
        return cls(view=view, projection=projection, width=width, height=height, depth_range=depth_range)

    @classmethod
    def orthographic(
        cls,
        eye: ArrayLike,
        target: ArrayLike,
        up: ArrayLike = (0.0, 1.0, 0.0),
        *,
        view_height: float,
        width: int,
        height: int,
        near: float = 0.0,
        far: float | None = None,
    ) -> Self:
        """Make an orthographic camera in the plane through `eye` that looks at `target`.

        Args:
            view_height: height of the visible box in scene units, > 0; its width follows from the
                aspect ratio.
            near, far: scene units along the view ray; `far` is 1e3 times the distance from
                `eye` to `target` by default.
            eye, target, up, width, height: as in `look_at`.
        """
        view = look_at_matrix(eye, target, up)
        view_height = checks.number("view_height", view_height, low=LEAST_SCALE, high=MOST_SCALE, unit="scene units")
        distance = float(np.linalg.norm(checks.vector("target", target, 3) - np.asarray(eye)))
        far = 1e3 * distance if far is None else far
        sy = 2.0 / view_height
        projection = orthographic_matrix(sy * height / width if width else sy, sy, near, far)
        return cls(view=view, projection=projection, width=width, height=height)

    @classmethod
    def from_intrinsics(
        cls,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        *,
        width: int,
        height: int,
        view: ArrayLike | None = None,
        near: float = 1e-3,
        far: float = math.inf,
    ) -> Self:
        """Make a perspective camera from a calibrated one.

        Args:
            fx, fy: focal lengths in pixels, > 0.
            cx, cy: principal point in pixels from the top left corner; (width / 2, height / 2) is
                the centre.
            width, height: pixels.
            view: [4, 4] world to view; identity by default. (Computer vision's convention, +y down
                and +z forward, differs: multiply such an extrinsic by diag(1, -1, -1, 1).)
            near, far: scene units.
        """
        fx = checks.number("fx", fx, low=0, above=True, unit="px")
        fy = checks.number("fy", fy, low=0, above=True, unit="px")
        cx, cy = checks.number("cx", cx, unit="px"), checks.number("cy", cy, unit="px")
        width = checks.integer("width", width, low=1, high=LARGEST_SIZE, unit="px")
        height = checks.integer("height", height, low=1, high=LARGEST_SIZE, unit="px")
        projection = perspective_matrix(
            2.0 * fx / width, 2.0 * fy / height, 2.0 * cx / width - 1.0, 1.0 - 2.0 * cy / height, near, far
        )
        view = np.eye(4) if view is None else view
        return cls(view=np.asarray(view), projection=projection, width=width, height=height)

    @property
    def size(self) -> tuple[int, int]:
        """(rows, columns), as in the shape of an array."""
        return self.height, self.width

    @property
    def is_orthographic(self) -> bool:
        """Whether all view rays are parallel."""
        return bool(self.projection[3, 3] == 1.0)

    @property
    def view_height(self) -> float:
        """Height of what is seen in scene units; of a perspective camera at depth 1.

        Tolerances that are shares of the depth are shares of this with an orthographic camera,
        whose distance is arbitrary: a perspective camera of 53 degrees sees as much at this depth.
        """
        return float(2.0 / self.projection[1, 1])

    def tolerance_depth(self, depth: NDArray[Any]) -> NDArray[Any]:
        """Return what relative tolerances are shares of: depths as given, orthographic the view's height."""
        return np.full_like(depth, self.view_height) if self.is_orthographic else depth

    @property
    def near(self) -> float:
        """Depth of the near plane in scene units."""
        return min(self._plane_depths())

    @property
    def far(self) -> float:
        """Depth of the far plane in scene units; may be infinite."""
        return max(self._plane_depths())

    def _plane_depths(self) -> tuple[float, float]:
        ends = (-1.0, 1.0) if self.depth_range == "-1..1" else (0.0, 1.0)
        return self._depth_of(ends[0]), self._depth_of(ends[1])

    def _depth_of(self, ndc: float) -> float:
        scale, offset = self.projection[2, 2], self.projection[2, 3]
        if self.is_orthographic:
            return float((offset - ndc) / scale)
        # ndc = (scale * -depth + offset) / depth; a vanishing divisor is an infinite far plane.
        divisor = ndc + scale
        return float(offset / divisor) if abs(divisor) > 1e-12 else math.inf

    @property
    def pixel_to_view(self) -> tuple[float, float, float, float]:
        """(sx, sy, ox, oy): view x = (sx * column + ox) * k, view y = (sy * row + oy) * k.

        `column` and `row` count from the top left corner, centres at +0.5; k is the linear depth
        for a perspective camera and 1 for an orthographic one; view z = -depth.
        """
        matrix = self.projection
        if self.is_orthographic:
            shift_x, shift_y = matrix[0, 3], matrix[1, 3]
        else:
            shift_x, shift_y = -matrix[0, 2], -matrix[1, 2]
        sx, sy = 2.0 / (self.width * matrix[0, 0]), -2.0 / (self.height * matrix[1, 1])
        return sx, sy, (-1.0 - shift_x) / matrix[0, 0], (1.0 - shift_y) / matrix[1, 1]

    @property
    def position(self) -> NDArray[np.float64]:
        """[3] world position of the eye (of the view plane's origin if orthographic)."""
        position: NDArray[np.float64] = -self.view[:3, :3].T @ self.view[:3, 3]
        return position

    def unproject(self, depth: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return the world position of every pixel centre at linear `depth`.

        Args:
            depth: [rows, columns] of this camera or with a margin of equal size on opposite sides.

        Returns:
            [rows, columns, 3] float64, world space; infinite or NaN where `depth` is infinite.
        """
        rows, columns = depth.shape
        sx, sy, ox, oy = self.pixel_to_view
        column = np.arange(columns) + 0.5 - (columns - self.width) / 2
        row = np.arange(rows) + 0.5 - (rows - self.height) / 2
        deep = depth.astype(np.float64)
        k = np.ones_like(deep) if self.is_orthographic else deep
        view = np.stack([(sx * column + ox) * k, (sy * row + oy)[:, None] * k, -deep], axis=-1)
        with np.errstate(invalid="ignore"):
            return (view - self.view[:3, 3]) @ self.view[:3, :3]

    def with_margin(self, margin: tuple[int, int]) -> Camera:
        """Return this camera with `margin` = (rows, columns) more pixels on every side."""
        rows, columns = margin
        return self.cropped(-columns, -rows, self.width + 2 * columns, self.height + 2 * rows)

    def cropped(self, left: float, top: float, width: int, height: int) -> Camera:
        """Return the camera of a rectangle of this camera's image plane.

        Args:
            left, top: pixels from the image's top left corner, whole or not; negative outside of the image.
            width, height: pixels, 1 to 16384; the rectangle may exceed the image on any side.
        """
        # A column c of the image is c - left of the rectangle: x' = a x + b in NDC.
        matrix, across, down = self.projection.copy(), self.width / width, self.height / height
        matrix[0] = across * matrix[0] + ((self.width - 2 * left) / width - 1.0) * matrix[3]
        matrix[1] = down * matrix[1] + (1.0 - (self.height - 2 * top) / height) * matrix[3]
        return Camera(view=self.view, projection=matrix, width=width, height=height, depth_range=self.depth_range)


def look_at_matrix(eye: ArrayLike, target: ArrayLike, up: ArrayLike) -> NDArray[np.float64]:
    """Return the [4, 4] float64 world-to-view matrix of an eye that looks at a target."""
    position, aim = checks.point("eye", eye), checks.point("target", target)
    if np.array_equal(position, aim):
        raise ValueError(f"eye and target are both {position.tolist()}: expected two points")
    backward = checks.direction("eye - target", position - aim)
    right = np.cross(checks.direction("up", up), backward)
    length = float(np.linalg.norm(right))
    if length < 1e-6:
        raise ValueError(
            f"up is {np.asarray(up).tolist()}: expected a direction not parallel to the view ray {(-backward).tolist()}"
        )
    right /= length
    view = np.eye(4)
    view[:3, :3] = right, np.cross(backward, right), backward
    view[:3, 3] = -view[:3, :3] @ position
    return view


def orthographic_matrix(scale_x: float, scale_y: float, near: float, far: float) -> NDArray[np.float64]:
    """Return a [4, 4] float64 projection of a box in the middle of the view."""
    near = checks.number("near", near, unit="scene units")
    far = checks.number("far", far, low=near, above=True, unit="scene units")
    matrix = np.diag([scale_x, scale_y, -2.0 / (far - near), 1.0])
    matrix[2, 3] = -(far + near) / (far - near)
    return matrix


def perspective_matrix(
    scale_x: float, scale_y: float, shift_x: float, shift_y: float, near: float, far: float, *, reversed_z: bool = False
) -> NDArray[np.float64]:
    """Return a [4, 4] float64 projection; `far` may be infinite, shifts are in NDC."""
    near = checks.number("near", near, low=0, above=True, unit="scene units")
    far = checks.number("far", far, low=near, above=True, unit="scene units", infinite=True)
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[0, 2] = scale_x, -shift_x
    matrix[1, 1], matrix[1, 2] = scale_y, -shift_y
    matrix[3, 2] = -1.0
    ratio = near / far  # 0 for an infinite far plane
    if reversed_z:
        matrix[2, 2], matrix[2, 3] = ratio / (1.0 - ratio), near / (1.0 - ratio)
    else:
        matrix[2, 2], matrix[2, 3] = -(1.0 + ratio) / (1.0 - ratio), -2.0 * near / (1.0 - ratio)
    return matrix
