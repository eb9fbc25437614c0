"""Auxiliary cameras of SSDO: their placement, and the passes that add what they see to a result.

Each surface counts once, by the first camera that shows it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.params import Params, param
from ssgi_cl.device.arrays import DeviceArray, Plane, Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, floats, ints
from ssgi_cl.techniques.ao.slices import SliceParams, pattern
from ssgi_cl.techniques.direct.layer_shading import SenderRecords
from ssgi_cl.techniques.source import Source
from ssgi_cl.techniques.ssdo.ssdo_points import POINTS, SsdoPoints

Doubles = NDArray[np.float64]

BLOCKS = (12, 16)
"""Rows and columns of blocks of the image; the view ray of each has candidate positions."""
SHARES = (0.3, 0.6, 0.9)
"""Candidate positions of a block, in parts of the distance to its nearest surface."""
BEYOND = 2.0
"""Length of view rays that meet nothing, in median depths."""
CLOSEST = 0.3
"""Least distance of a position from the median point, in parts of the camera's own distance."""
YFOV = 1.6
"""Vertical field of view in radians, wide because the median point is near."""

TRANSFORM = (*ROTATION, "shift_x", "shift_y", "shift_z")
"""Members of a struct that hold a transform between view spaces, see `_transform`."""
EDGES = tuple(
    f"{side}_{axis}"
    for side, axes in (("left", "xzw"), ("right", "xzw"), ("top", "yzw"), ("bottom", "yzw"))
    for axis in axes
)
OTHER_VIEW = Struct("OtherViewParams", (*floats(*TRANSFORM, "nearest"), ("columns", "int"), ("rows", "int")))
VIEWS = Struct(
    "ViewsParams",
    (
        *floats("radius", "most_px", "bias", "depth_bias", "nearest", *TRANSFORM, *EDGES),
        *ints("columns", "rows", "margin_left", "margin_right", "margin_top", "margin_bottom"),
    ),
)

DEPTH_BIAS = 4e-6
"""Bias relative to depth: some roundings of float32 positions in two view spaces (2^-24 each)."""
NEAREST = 1e-3
"""Least depth of points that a camera shows, in radii."""


@checked_keywords
def auxiliary_cameras(
    camera: Camera, gbuffer: GBuffer | DeviceGBuffer | ArrayLike, count: int = 4, *, size: float = 0.5
) -> list[Camera]:
    """Place cameras that see what a camera misses.

    All look at the median of the visible points. Each stands in free space, on a view ray of the
    camera and at most 0.9 of the way to the nearest surface of a block of the image, so none is in
    or behind a wall. All stand within the box round the camera and the visible points. Each takes
    the position whose direction from the median point is most unlike those of all cameras before
    it, beginning with the camera itself.

    Args:
        camera: the camera whose hidden surfaces are looked for.
        gbuffer: what it sees: a G-buffer, or its depth [rows, columns] in scene units without
            margin.
        count: cameras, 0 to 64.
        size: rows and columns, in parts of the camera's, in (0, 1].

    Returns:
        Perspective cameras, the most unlike first; none where nothing is seen.

    Raises:
        TypeError, ValueError: an argument of the wrong type, shape or range.
    """
    if not isinstance(camera, Camera):
        raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
    count = checks.integer("count", count, low=0, high=64)
    size = checks.number("size", size, low=0.0, high=1.0, above=True, unit="of the camera's size")
    depth = _depth(camera, gbuffer)
    if not np.isfinite(depth).any():
        return []
    target, places = _places(camera, depth)
    own = camera.position - target
    ways = places - target
    distance = np.linalg.norm(ways, axis=-1)
    far_enough = distance >= CLOSEST * float(np.linalg.norm(own))
    places, ways = places[far_enough], ways[far_enough] / distance[far_enough, None]
    likeness = ways @ (own / np.linalg.norm(own))
    rows, columns = (max(1, round(size * pixels)) for pixels in camera.size)
    cameras: list[Camera] = []
    for _ in range(min(count, len(places))):
        chosen = int(np.argmin(likeness))
        up = camera.view[1, :3]
        if abs(ways[chosen] @ up) > 0.99:
            up = camera.view[0, :3]
        cameras.append(Camera.look_at(places[chosen], target, up, yfov=YFOV, width=columns, height=rows))
        likeness = np.maximum(likeness, ways @ ways[chosen])
    return cameras


def _depth(camera: Camera, gbuffer: GBuffer | DeviceGBuffer | ArrayLike) -> NDArray[np.float32]:
    """Return the front layer's depth [rows, columns] without margin."""
    if isinstance(gbuffer, DeviceGBuffer):
        rows, columns = gbuffer.margin
        whole = gbuffer.depth.download()[0]
        depth: NDArray[np.float32] = whole[rows : whole.shape[0] - rows, columns : whole.shape[1] - columns]
    elif isinstance(gbuffer, GBuffer):
        first = gbuffer.first("depth")
        assert first is not None  # noqa: S101  every G-buffer has a depth
        depth = gbuffer.inner(first)
    else:
        depth = checks.plane("gbuffer", np.asarray(gbuffer), unit="scene units", low=0.0, infinite=True)
    if depth.shape != camera.size:
        raise ValueError(f"gbuffer has size {depth.shape}: expected {camera.size} as the camera")
    return depth


def _places(camera: Camera, depth: NDArray[np.float32]) -> tuple[Doubles, Doubles]:
    """Return the median visible point [3] and free positions [n, 3], world space."""
    rows, columns = (min(b, s) for b, s in zip(BLOCKS, camera.size, strict=True))
    starts = [np.arange(n) * s // n for n, s in zip((rows, columns), camera.size, strict=True)]
    nearest = np.minimum.reduceat(np.minimum.reduceat(depth, starts[0], 0), starts[1], 1)
    small = replace(camera, width=columns, height=rows)
    seen = np.isfinite(nearest)
    limit = BEYOND * float(np.median(nearest[seen]))
    free = np.where(seen, nearest, limit).astype(np.float32)
    visible = small.unproject(free)[seen]
    box = np.vstack([visible, camera.position])
    places = np.concatenate([small.unproject(np.float32(share) * free).reshape(-1, 3) for share in SHARES])
    within = ((places >= box.min(axis=0)) & (places <= box.max(axis=0))).all(axis=-1)
    return np.median(visible, axis=0), places[within]


def _filled(gbuffer: DeviceGBuffer) -> Camera:
    """Return the camera of the contents."""
    if gbuffer.camera is None:
        raise ValueError("a device G-buffer is empty: draw or upload something first")
    return gbuffer.camera


def _transform(camera: Camera, other: Camera) -> Mapping[str, float]:
    """Return the struct members of the transform from one camera's view space to another's.

    In float64, since both cameras may be far from the world's origin and near each other.
    """
    turn = other.view[:3, :3] @ camera.view[:3, :3].T
    shift = other.view[:3, 3] - turn @ camera.view[:3, 3]
    return dict(zip(TRANSFORM, [*turn.ravel().tolist(), *shift.tolist()], strict=True))


def _packed_other(camera: Camera, other: Camera, whole: Size, radius: float) -> Any:
    """Return the struct of another view, whose planes have (rows, columns) `whole`."""
    return OTHER_VIEW.pack(
        {**_transform(camera, other), "nearest": NEAREST * radius, "rows": whole[0], "columns": whole[1]}
    )


class UnseenDepth:
    """Depth of the surfaces of a view that no earlier view shows.

    Args:
        runtime: the device.
        radius: of the technique, scene units: points nearer to a camera than a thousandth of it
            have no image.
    """

    def __init__(self, runtime: Runtime, radius: float) -> None:
        self.runtime = runtime
        self.radius = radius
        # Camera, camera struct, depth and normals of each view since `begin`.
        self._before: list[tuple[Camera, Any, Plane, Plane]] = []

    def begin(self, gbuffer: DeviceGBuffer) -> None:
        """Forget all views but the first one, whose G-buffer is given."""
        self._before = [(_filled(gbuffer), gbuffer.camera_struct, gbuffer.depth, gbuffer.normal)]

    def end(self) -> None:
        """Forget all views."""
        self._before = []

    def of(self, view: DeviceGBuffer) -> Plane:
        """Queue the passes; return the depth, INFINITY where an earlier view shows the surface.

        From the next call on the view itself is an earlier one.
        """
        camera = _filled(view)
        unseen = self.runtime.transient.plane(view.layers, view.whole, math.inf)
        unseen.copy_image(0, view.depth, view.layers)
        for earlier, earlier_struct, depth, normal in self._before:
            kernel = self.runtime.kernel(
                "ssdo/ssdo_views_unseen.cl",
                {
                    "UNSEEN_LAYERS": view.layers,
                    "UNSEEN_NORMALS": min(view.normal.count // 3, view.layers),
                    "SEEN_LAYERS": depth.count,
                    "SEEN_NORMALS": min(normal.count // 3, depth.count),
                },
                (CAMERA, OTHER_VIEW),
            )
            kernel.run(
                view.whole,
                region=view.region,
                normal=view.normal,
                earlier=depth,
                facing=normal,
                depth=unseen,
                camera=view.camera_struct,
                before=earlier_struct,
                view=_packed_other(camera, earlier, depth.size, self.radius),
            )
        # The next view may be drawn to the same memory.
        kept_depth = self.runtime.transient.plane(view.layers, view.whole, math.inf)
        kept_normal = self.runtime.transient.plane(view.normal.count, view.whole)
        kept_depth.copy_image(0, view.depth, view.layers)
        kept_normal.copy_image(0, view.normal, view.normal.count)
        self._before.append((camera, view.camera_struct, kept_depth, kept_normal))
        return unseen


@dataclass(frozen=True, kw_only=True)
class ViewsParams(Params):
    """Parameters of auxiliary cameras with the bitmask."""

    strata: int = param(2, "directions that are tried in each slice", low=1, high=16)
    taps: int = param(4, "depths read along each direction", low=1, high=64)
    bias: float = param(
        0.2,
        "height above the tangent plane up to which nothing occludes",
        low=0.0,
        high=100.0,
        unit="px of the other camera",
    )


class SsdoViews:
    """Auxiliary cameras of `SsdoBitmask`, prepared for its parameters.

    Args:
        runtime: the device.
        slices: the parameters of the bitmask, of which radius and slices count here.
        params: see `ViewsParams`.

    Attributes:
        unseen: the views so far. Surfaces that one of them shows are left to it.
    """

    def __init__(self, runtime: Runtime, slices: SliceParams, params: ViewsParams | None = None) -> None:
        self.runtime = runtime
        self.slices = slices
        self.params = params or ViewsParams()
        self.unseen = UnseenDepth(runtime, slices.radius)
        self._table = runtime.array(slice_table(slices))

    def set(self, slices: SliceParams) -> None:
        """Take the values of other parameters of the bitmask, of the same shape."""
        self.slices = slices
        self.unseen.radius = slices.radius

    def add(
        self,
        light: Plane,
        masks: DeviceArray,
        gbuffer: DeviceGBuffer,
        source: Source,
        other: DeviceGBuffer,
        radiance: Plane | None,
    ) -> None:
        """Queue the passes of one auxiliary camera.

        Args:
            light: the result of `SsdoBitmask.run`: A shrinks, the last 3 images grow.
            masks: its `masks`. Newly covered sectors are added; sectors whose sender is found are
                no longer marked as without one.
            gbuffer: the G-buffer of both; its camera counts.
            source: the same, or it reduced to the size of `light`.
            other: what the auxiliary camera sees, of any size and number of layers.
            radiance: of its surfaces, 3 images for each layer, W m^-2 sr^-1; None if `light` has
                no bounce.
        """
        packed = self._packed(light, gbuffer, source, other)
        kernel = self.runtime.kernel(
            "ssdo/ssdo_views.cl",
            {
                "VIEWS_SLICES": self.slices.slices,
                "VIEWS_STRATA": self.params.strata,
                "VIEWS_TAPS": self.params.taps,
                "VIEWS_LAYERS": other.layers,
                "VIEWS_NORMALS": min(other.normal.count // 3, other.layers),
                "VIEWS_SENDERS": 0 if radiance is None else min(radiance.count, other.normal.count) // 3,
                "VIEWS_BOUNCE": max(light.count - 3, 1),
            },
            (CAMERA, VIEWS),
        )
        kernel.run(
            light.size,
            linear=source.linear,
            normal=source.normal,
            table=self._table,
            depth=self.unseen.of(other),
            seen=other.normal,
            radiance=radiance,
            light=light,
            masks=masks,
            camera=source.camera_struct,
            other=other.camera_struct,
            params=packed,
        )

    def _packed(self, light: Plane, gbuffer: DeviceGBuffer, source: Source, other: DeviceGBuffer) -> Any:
        rows, columns = light.size
        further = _filled(other)
        return VIEWS.pack(
            {
                "radius": self.slices.radius,
                "most_px": self.slices.max_radius_px / getattr(source, "step", 1),
                "bias": self.params.bias,
                "depth_bias": DEPTH_BIAS,
                "nearest": NEAREST * self.slices.radius,
                **_transform(_filled(gbuffer), further),
                **_edges(further, other.margin),
                "columns": other.whole[1],
                "rows": other.whole[0],
                "margin_left": source.margin[1],
                "margin_right": source.whole[1] - columns - source.margin[1],
                "margin_top": source.margin[0],
                "margin_bottom": source.whole[0] - rows - source.margin[0],
            }
        )


def _edges(camera: Camera, margin: Size) -> Mapping[str, float]:
    """Return the planes through the edges of a camera's image, as distances that grow inwards."""
    to_x, to_y, at_x, at_y = camera.pixel_to_view
    rows, columns = margin
    values: dict[str, float] = {}
    for axis, names, to, at, low, high in (
        ("x", ("left", "right"), to_x, at_x, -columns, camera.width + columns),
        ("y", ("bottom", "top"), to_y, at_y, -rows, camera.height + rows),
    ):
        for name, end, sign in zip(names, sorted((to * low + at, to * high + at)), (1.0, -1.0), strict=True):
            length = 1.0 if camera.is_orthographic else math.hypot(1.0, end)
            values[f"{name}_{axis}"] = sign / length
            values[f"{name}_z"] = 0.0 if camera.is_orthographic else sign * end / length
            values[f"{name}_w"] = -sign * end if camera.is_orthographic else 0.0
    return values


def slice_table(params: SliceParams) -> NDArray[np.float32]:
    """Return [4 rows, slices, 3, 16 columns] as kernels/ssdo/ssdo_views.cl reads it."""
    made = pattern(params)
    fields = np.stack([np.cos(made.angle), np.sin(made.angle), made.dither], axis=-1)
    return np.ascontiguousarray(np.tile(fields.transpose(0, 2, 3, 1), 4), np.float32)


def add_point_view(
    points: SsdoPoints, light: Plane, gbuffer: DeviceGBuffer, other: DeviceGBuffer, records: SenderRecords | None
) -> None:
    """Queue the pass of one auxiliary camera of `SsdoPoints`.

    Only unoccluded directions are traced, so each direction meets at most one surface.

    Args:
        points: the back end with `kept`, to which the directions that meet a surface are added.
        light: its result: A and the sky's irradiance shrink, the last 3 images grow.
        gbuffer: the G-buffer of both.
        other: what the auxiliary camera sees, of any size and number of layers.
        records: what its surfaces send. None if `light` has no bounce or all is dark.
    """
    view = _packed_other(_filled(gbuffer), _filled(other), other.whole, points.params.radius)
    if points.kept is None or points.wide_directions is None:
        raise ValueError("points keeps no directions: expected one that was made with kept=True")
    if records is not None and not points.bounces:
        raise ValueError("there are records: expected None, as points gathered no bounce")
    thickness = points.params.thickness_of(other)
    kernel = points.runtime.kernel(
        "ssdo/ssdo_point_views.cl",
        {
            **points.params.macros(other.layers, thickness),
            "POINT_VIEWS_COUNT": points.params.samples,
            "POINT_VIEWS_SENDERS": 0 if records is None else records.layers,
            "POINT_VIEWS_STEP": points.step,
            "POINT_VIEWS_SKY": int(light.count > 1 + 3 * points.bounces),
        },
        (CAMERA, POINTS, OTHER_VIEW),
    )
    kernel.run(
        light.size,
        depth=gbuffer.depth,
        normal=gbuffer.normal,
        directions=points.wide_directions,
        planes=points.planes_of(other, other.layers),
        thickness=thickness,
        senders=None if records is None else records.array,
        gathered=light,
        kept=points.kept,
        camera=gbuffer.camera_struct,
        other=other.camera_struct,
        params=points.packed(gbuffer),
        view=view,
    )
