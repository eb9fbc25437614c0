"""Ambient occlusion from rays against the mesh: slow, and as exact as one has time for."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal, overload
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl import check
from ssgi_cl.camera import Camera
from ssgi_cl.errors import MissingExtraError
from ssgi_cl.gbuffer import GBuffer
from ssgi_cl.rasterize.scene import Scene

Doubles = NDArray[np.float64]
Floats = NDArray[np.float32]

WEIGHTINGS = ("cosine", "uniform")
ATTENUATIONS = ("none", "linear", "quadratic", "exponential")

MOST_RAYS = 1 << 20
"""Rays per pixel, at most."""

OFFSET = 2.0**-20
"""Height above its triangle at which a ray starts, relative to the magnitude of the coordinates
and of the triangle: 16 roundings of float32, in which Embree computes. On planes tilted at random
(5e7 rays) none met its own plane from 2^-21 on, one did at 2^-22, and a thousandth at 2^-25."""

SAME_SURFACE = 1e-4
"""Share of the depth within which the mesh and a given G-buffer show the same surface."""

BATCHES = 8
"""Independent sets of rays of a pixel, whose spread tells the error. More tell it better and make
it greater: at 256 rays on both built-in scenes, 1, 2, 4, 8 and 16 sets have an RMSE in the ratio
1 : 1.24 : 1.34 : 1.7 : 1.95."""

_PIXELS = 8192  # of a block, the unit of work of a thread
_RAYS = 1 << 18  # traced in one go; more of them leave the cache
_FIRST_LOOK = 4  # rays of each batch before the error is first compared with the target
_GROWTH = 1.5  # of the number of rays from one such look to the next


class RayAo:
    """Ambient occlusion of a scene from rays, prepared for many cameras.

    Args:
        scene: triangles; copied, so that the scene itself need not be kept.

    Raises:
        TypeError: not a scene.
        MissingExtraError: embreex is not installed.
    """

    def __init__(self, scene: Scene) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(
                f"scene is {type(scene).__name__}: expected a Scene "
                "(see ssgi_cl.rasterize.load_scene)"
            )
        rtcore_scene, mesh_construction = _embree()
        used = scene.positions[scene.triangles.ravel()].astype(np.float64)
        low, high = used.min(axis=0), used.max(axis=0)
        largest = float(np.abs(used).max())
        # A power of two makes all sizes alike and changes no digit.
        self._scale = 2.0 ** -math.frexp(largest)[1] if largest > 0.0 else 1.0
        self._origin = scene.origin
        self._middle = 0.5 * (low + high) * self._scale
        self._reach = 0.51 * float(np.linalg.norm(high - low)) * self._scale
        self._positions = (scene.positions * np.float64(self._scale)).astype(np.float32)
        self._triangles = scene.triangles
        self._normals = scene.normals
        self._rays = rtcore_scene.EmbreeScene(robust=True)
        mesh_construction.TriangleMesh(self._rays, self._positions, self._triangles)
        self._rays.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))  # builds the tree

    def __call__(
        self,
        camera: Camera,
        radius: float = 0.5,
        rays: int = 256,
        *,
        weighting: str = "cosine",
        attenuation: str | ArrayLike = "none",
        target_error: float | None = None,
        estimate_error: bool = True,
        progress: Callable[[float], object] | None = None,
        gbuffer: GBuffer | None = None,
    ) -> tuple[Floats, Floats]:
        """Return A and its standard error, [rows, columns] float32 each; see `ray_ao`.

        Without `estimate_error` (and without a target) all rays are one batch: the error is then
        smaller, but unknown, and infinite wherever something is seen.
        """
        split = estimate_error or target_error is not None
        settings = _Settings.of(radius, rays, weighting, attenuation, target_error, split)
        if not isinstance(camera, Camera):
            raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
        _check_gbuffer(gbuffer, camera)
        rows, columns = camera.size
        openness = np.ones((rows, columns), np.float32)
        error = np.zeros((rows, columns), np.float32)
        height = max(1, _PIXELS // columns)

        def work(first: int) -> int:
            block = slice(first, min(first + height, rows))
            spots = self._spots(camera, block, gbuffer)
            if len(spots.pixel):
                occluded, deviation = self._occlusion(spots, settings)
                openness.ravel()[spots.pixel] = np.clip(1.0 - occluded, 0.0, 1.0)
                error.ravel()[spots.pixel] = deviation
            return block.stop

        with ThreadPoolExecutor(_threads()) as pool:
            for done in pool.map(work, range(0, rows, height)):
                if progress is not None:
                    progress(done / rows)
        return openness, error

    def _spots(self, camera: Camera, rows: slice, gbuffer: GBuffer | None) -> _Spots:
        """Return what the camera sees through the pixel centres of some rows."""
        start, along = _sight(camera, rows, self._origin, self._scale)
        pixel = np.arange(rows.start * camera.width, rows.stop * camera.width)
        length = np.linalg.norm(along, axis=-1)
        if gbuffer is None:
            # A ray starts and ends at the sphere round the scene: far from it float32 is coarse.
            depth = np.sum((self._middle - start) * along, axis=-1) / length**2
            near = np.maximum(camera.near * self._scale, depth - self._reach / length)
            far = np.minimum(camera.far * self._scale, depth + self._reach / length)
        else:
            depth = _first(gbuffer, "depth")[rows].ravel() * self._scale
            near, far = depth * (1.0 - SAME_SURFACE), depth * (1.0 + SAME_SURFACE)
        seen = (near < far) & np.isfinite(depth)
        start, along, pixel, length = start[seen], along[seen], pixel[seen], length[seen]
        near, far, depth = near[seen], far[seen], depth[seen]
        hit = self._rays.run(
            (start + near[:, None] * along).astype(np.float32),
            (along / length[:, None]).astype(np.float32),
            ((far - near) * length).astype(np.float32),
            output=1,
        )
        met = hit["primID"] != -1
        if gbuffer is None:
            along, pixel = along[met], pixel[met]
            point, normal, axis, size = self._surface(hit, met)
        else:
            point = start + depth[:, None] * along
            axis = _inner_normal(gbuffer, rows, along.shape, seen)
            normal, size = -along / length[:, None], np.abs(point).max(axis=-1)
            normal = np.where(axis.any(axis=-1, keepdims=True), axis, normal)
            # Where the mesh is not found, the surface may lie this far before the G-buffer's.
            size = np.where(met, size, SAME_SURFACE / OFFSET * depth)
            if met.any():
                point[met], normal[met], _, size[met] = self._surface(hit, met)
        normal = np.where(np.sum(normal * along, axis=-1, keepdims=True) > 0.0, -normal, normal)
        axis = np.where(axis.any(axis=-1, keepdims=True), axis, normal)
        axis = np.where(np.sum(axis * normal, axis=-1, keepdims=True) < 0.0, -axis, axis)
        return _Spots(
            pixel,
            (point + normal * (OFFSET * size)[:, None]).astype(np.float32),
            normal.astype(np.float32),
            (axis / np.linalg.norm(axis, axis=-1, keepdims=True)).astype(np.float32),
        )

    def _surface(
        self, hit: dict[str, Any], met: NDArray[np.bool_]
    ) -> tuple[Doubles, Doubles, Doubles, Doubles]:
        """Return point, normal of the triangle, mesh's normal (or 0) and size of coordinates."""
        triangle = self._triangles[hit["primID"][met]]
        corner = self._positions[triangle].astype(np.float64)
        u, v = (hit[name][met].astype(np.float64)[:, None] for name in "uv")
        w = 1.0 - u - v
        # From the corners, not along the ray: so the point lies on the triangle.
        point = w * corner[:, 0] + u * corner[:, 1] + v * corner[:, 2]
        first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        size = np.abs(point).max(axis=-1) + np.maximum(
            np.abs(first).max(axis=-1), np.abs(second).max(axis=-1)
        )
        normal = np.cross(first, second)
        # Embree meets no triangle without an area in float64; 1 guards against rounding.
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-300)
        mesh = self._normals[triangle].astype(np.float64)
        return point, normal, w * mesh[:, 0] + u * mesh[:, 1] + v * mesh[:, 2], size

    def _occlusion(self, spots: _Spots, settings: _Settings) -> tuple[Doubles, Doubles]:
        """Return the occluded share of each spot and its standard error."""
        count, batches = len(spots.pixel), settings.batches
        shift = _hashed(spots.pixel, 2 * batches)  # [2 * batches, count]
        sums = np.zeros((batches, count))
        step = max(1, _RAYS // (batches * count))
        start = np.tile(spots.start, (step * batches, 1))
        axes = _axes(spots.axis)
        done = 0
        for level in settings.levels:
            for first in range(done, level, step):
                point = _points(first, min(first + step, level))
                u = _wrapped(point[:, 0, None, None] + shift[None, :batches])
                v = _wrapped(point[:, 1, None, None] + shift[None, batches:])
                way = _directions(u, v, axes, settings.weighting)
                below = np.einsum("kbnd,nd->kbn", way, spots.normal) <= 0.0
                weight = self._weights(start[: u.size], way.reshape(-1, 3), below.ravel(), settings)
                sums += weight.reshape(u.shape).sum(axis=0)
            done = level
            mean, deviation = _mean_and_error(sums / level)
            if settings.target is not None and level >= _FIRST_LOOK and (
                math.sqrt(float(np.mean(deviation**2))) <= settings.target
            ):
                break
        return mean, deviation

    def _weights(
        self, start: Floats, way: Floats, below: NDArray[np.bool_], settings: _Settings
    ) -> Floats:
        """Return V * W of each ray; those that start into the surface meet it at distance 0."""
        reach = np.float32(settings.radius * self._scale)
        reaches = np.where(below, np.float32(-1.0), reach)  # negative: not traced
        if settings.curve is None:
            blocked = self._rays.run(start, way, reaches, query="OCCLUDED") != -1
            weight: Floats = (blocked | below).astype(np.float32)
            return weight
        distance = self._rays.run(start, way, reaches, query="DISTANCE")
        share = np.where(below, np.float32(0.0), distance / reach)
        weight = settings.curve(np.clip(share, 0.0, 1.0)).astype(np.float32)
        weight[~below & (distance >= reach)] = 0.0
        return weight


@dataclass(frozen=True, eq=False)
class _Spots:
    """Where rays start.

    Attributes:
        pixel: [n] index into the flat image.
        start: [n, 3] a little above the surface, in the ray caster's coordinates.
        normal: [n, 3] of the triangle, facing the viewer.
        axis: [n, 3] of the hemisphere, unit length.
    """

    pixel: NDArray[np.int64]
    start: Floats
    normal: Floats
    axis: Floats


@dataclass(frozen=True, eq=False)
class _Settings:
    radius: float
    batches: int
    levels: tuple[int, ...]
    """Numbers of rays of each batch at which the error is estimated; the last one ends."""
    weighting: str
    curve: Callable[[Floats], Floats] | None
    target: float | None

    @classmethod
    def of(
        cls,
        radius: object,
        rays: object,
        weighting: object,
        attenuation: str | ArrayLike,
        target_error: object,
        split: bool,
    ) -> _Settings:
        reach = check.number(
            "radius", radius, low=0, above=True, unit="scene units", infinite=True
        )
        count = check.integer("rays", rays, low=1, high=MOST_RAYS, unit="rays per pixel")
        batches = min(BATCHES, max(math.isqrt(count), min(count, 2))) if split else 1
        last = count // batches
        levels: list[int] = []
        target = None
        if target_error is not None:
            target = check.number("target_error", target_error, low=0, high=1, unit="of A")
            level = _FIRST_LOOK
            while level < last:
                levels.append(level)
                level = math.ceil(level * _GROWTH)
        curve = _curve(attenuation)
        if curve is not None and math.isinf(reach):
            raise ValueError(
                f"radius is {reach}: expected a finite number (scene units) with an attenuation, "
                "whose distances are shares of the radius"
            )
        weighting = check.choice("weighting", weighting, WEIGHTINGS)
        return cls(reach, batches, (*levels, last), weighting, curve, target)


def _curve(attenuation: str | ArrayLike) -> Callable[[Floats], Floats] | None:
    """Return W as a function of the distance in radii, or None where it is 1."""
    if not isinstance(attenuation, str):
        values = check.vector("attenuation", attenuation, np.size(attenuation))
        if not 2 <= len(values) <= 4096 or values.min() < 0.0 or values.max() > 1.0:
            raise ValueError(
                f"attenuation has {len(values)} values from {values.min(initial=np.inf):g} to "
                f"{values.max(initial=-np.inf):g}: expected 2 to 4096 values in [0, 1]"
            )
        places = np.linspace(0.0, 1.0, len(values))
        return lambda share: np.interp(share, places, values)  # type: ignore[return-value]
    curves: dict[str, Callable[[Floats], Floats] | None] = {
        "none": None,
        "linear": lambda share: np.float32(1.0) - share,
        "quadratic": lambda share: np.float32(1.0) - share * share,
        "exponential": lambda share: np.exp(-share),
    }
    return curves[check.choice("attenuation", attenuation, ATTENUATIONS)]


def _check_gbuffer(gbuffer: object, camera: Camera) -> None:
    if gbuffer is None:
        return
    if not isinstance(gbuffer, GBuffer):
        raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected an ssgi_cl.GBuffer")
    seen = gbuffer.camera
    if seen.size != camera.size:
        raise ValueError(
            f"gbuffer has {seen.height} rows and {seen.width} columns: expected "
            f"{camera.height} x {camera.width} as the camera"
        )
    if not np.array_equal(seen.view, camera.view) or not np.array_equal(
        seen.projection, camera.projection
    ):
        raise ValueError("gbuffer has another camera: expected the same view and projection")


def _first(gbuffer: GBuffer, name: str) -> Floats:
    array = gbuffer.first(name)
    if array is None:
        raise ValueError(f"gbuffer has no {name}")
    return gbuffer.inner(array)


def _inner_normal(
    gbuffer: GBuffer, rows: slice, shape: tuple[int, ...], seen: NDArray[np.bool_]
) -> Doubles:
    """Return the G-buffer's normals of the pixels `seen` in some rows; 0 where it has none."""
    if gbuffer.normal is None:
        return np.zeros(shape)
    return _first(gbuffer, "normal")[rows].reshape(-1, 3)[seen].astype(np.float64)


def _sight(
    camera: Camera, rows: slice, origin: Doubles, scale: float
) -> tuple[Doubles, Doubles]:
    """Return [n, 3] where lines of sight start, and [n, 3] by what they advance per unit depth.

    World space relative to `origin`, times `scale`; pixel centres of some rows, row by row.
    """
    sx, sy, ox, oy = camera.pixel_to_view
    column, row = np.arange(camera.width) + 0.5, np.arange(rows.start, rows.stop) + 0.5
    x, y = np.meshgrid(sx * column + ox, sy * row + oy)
    across = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=-1)
    ahead = np.array([0.0, 0.0, -1.0])
    turn = camera.view[:3, :3]
    eye = (-(camera.view[:3, 3] + turn @ origin) * scale) @ turn
    if camera.is_orthographic:
        start = eye + scale * (across @ turn)
        return start, np.broadcast_to(ahead @ turn, start.shape).copy()
    along = (across + ahead) @ turn
    return np.broadcast_to(eye, along.shape).copy(), along


def _axes(axis: Floats) -> tuple[Floats, Floats, Floats]:
    """Return three unit vectors [n, 3] at right angles of which the last is `axis`.

    Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
    """
    x, y, z = axis.T
    sign = np.copysign(np.float32(1.0), z)
    a = np.float32(-1.0) / (sign + z)
    b = x * y * a
    first = np.stack([np.float32(1.0) + sign * x * x * a, sign * b, -sign * x], axis=-1)
    second = np.stack([b, sign + y * y * a, -y], axis=-1)
    return first, second, axis


def _directions(
    u: Floats, v: Floats, axes: tuple[Floats, Floats, Floats], weighting: str
) -> Floats:
    """Return [..., n, 3] unit vectors of hemispheres from u, v [..., n] in [0, 1)."""
    one = np.float32(1.0)
    if weighting == "cosine":
        ring, height = np.sqrt(u), np.sqrt(one - u)
    else:
        height = one - u
        ring = np.sqrt(u * (one + height))
    angle = np.float32(2.0 * math.pi) * v
    east, north = ring * np.cos(angle), ring * np.sin(angle)
    way = np.empty((*u.shape, 3), np.float32)
    for d in range(3):
        way[..., d] = east * axes[0][:, d] + north * axes[1][:, d] + height * axes[2][:, d]
    return way


def _points(first: int, last: int) -> Floats:
    """Return points `first` to `last` of the R2 sequence (Roberts 2018) in [0, 1)^2."""
    root = 1.32471795724474602596  # of g^3 = g + 1
    index = np.arange(first + 1, last + 1, dtype=np.float64)
    points: Floats = np.mod(index[:, None] / (root, root * root), 1.0).astype(np.float32)
    return points


def _wrapped(values: Floats) -> Floats:
    """Return `values` in [0, 2) moved to [0, 1)."""
    values -= values >= 1.0
    return values


def _hashed(pixel: NDArray[np.int64], count: int) -> Floats:
    """Return [count, n] numbers in [0, 1): the same for the same pixel, otherwise at random.

    Each pixel's and batch's points are moved by two of them round the unit square (Cranley and
    Patterson 1976), which keeps them well spread and makes the mean of each batch unbiased.
    """
    # Two rounds of splitmix64's finaliser (Steele et al. 2014) per number.
    state = pixel.astype(np.uint64)[None, :] * np.uint64(2 * BATCHES)
    state = (state + np.arange(count, dtype=np.uint64)[:, None]) * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        state = (state ^ (state >> np.uint64(shift))) * np.uint64(factor)
    state ^= state >> np.uint64(31)
    numbers: Floats = (state >> np.uint64(40)).astype(np.float32) * np.float32(2.0**-24)
    return numbers


def _mean_and_error(batches: Doubles) -> tuple[Doubles, Doubles]:
    """Return mean [n] of independent estimates [batches, n] and its standard error."""
    mean: Doubles = batches.mean(axis=0)
    if len(batches) < 2:
        return mean, np.full_like(mean, np.inf)
    deviation: Doubles = batches.std(axis=0, ddof=1) / math.sqrt(len(batches))
    return mean, deviation


def _threads() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _embree() -> tuple[Any, Any]:
    try:
        from embreex import mesh_construction, rtcore_scene
    except ImportError as error:
        raise MissingExtraError(
            "ray casting needs embreex, which is not installed: pip install 'ssgi-cl[truth]'"
        ) from error
    return rtcore_scene, mesh_construction


_kept: WeakKeyDictionary[Scene, RayAo] = WeakKeyDictionary()


@overload
def ray_ao(
    scene: Scene,
    camera: Camera,
    radius: float = 0.5,
    rays: int = 256,
    *,
    weighting: str = "cosine",
    attenuation: str | ArrayLike = "none",
    target_error: float | None = None,
    return_error: Literal[False] = False,
    progress: Callable[[float], object] | None = None,
    gbuffer: GBuffer | None = None,
) -> Floats: ...


@overload
def ray_ao(
    scene: Scene,
    camera: Camera,
    radius: float = 0.5,
    rays: int = 256,
    *,
    weighting: str = "cosine",
    attenuation: str | ArrayLike = "none",
    target_error: float | None = None,
    return_error: Literal[True],
    progress: Callable[[float], object] | None = None,
    gbuffer: GBuffer | None = None,
) -> tuple[Floats, Floats]: ...


def ray_ao(
    scene: Scene,
    camera: Camera,
    radius: float = 0.5,
    rays: int = 256,
    *,
    weighting: str = "cosine",
    attenuation: str | ArrayLike = "none",
    target_error: float | None = None,
    return_error: bool = False,
    progress: Callable[[float], object] | None = None,
    gbuffer: GBuffer | None = None,
) -> Floats | tuple[Floats, Floats]:
    """Compute ambient occlusion by rays from what each pixel's centre shows to the scene's mesh.

    A = 1 - (1/pi) Int V W cos dw ("cosine") or 1 - (1/2pi) Int V W dw ("uniform") over the
    hemisphere round the mesh's interpolated normal, which is turned to the side of the triangle
    that faces the viewer. V is 1 where a ray meets a triangle, from either side, within `radius`.
    Rays that this hemisphere sends below the triangle they start from meet it at distance 0: a
    coarse mesh with smooth normals is darker at its rim, as the mesh is. Holes that a texture's
    alpha cuts out are solid here.

    Rays start above their triangle by 1e-6 of its size and of its distance from the scene's
    origin; what is nearer than that is not seen.

    Args:
        scene: what `rasterize.load_scene` returns; its search tree is kept as long as the scene.
        camera: whose near and far plane bound what is seen, but not what occludes.
        radius: how far rays go, scene units, > 0; may be infinite without an attenuation.
        rays: per pixel, 1 to 2^20, at most. With `target_error` or `return_error` they are split
            into independent batches, 8 from 64 rays on and about the square root of `rays` below,
            and rounded down to a multiple of that; the error is then 1.7 times that of a single,
            better spread set.
        weighting: of directions, "cosine" or "uniform".
        attenuation: W at distance d in radii: "none" (1), "linear" (1 - d), "quadratic"
            (1 - d^2), "exponential" (e^-d), or 2 to 4096 values in [0, 1] at equal steps of d
            from 0 to 1, between which it is linear.
        target_error: stop when the root of the mean square of the standard errors of the pixels
            that show something is at most this, part by part of the image, or at `rays`.
        return_error: return the standard error too.
        progress: called with the share that is done, which grows to 1.
        gbuffer: take visible points and normals from this G-buffer of the same scene and camera
            instead of from rays; the mesh is looked for within 1e-4 of its depth. Where it has no
            normals, the triangles' are used.

    Returns:
        A [rows, columns] float32 in [0, 1], 1 where nothing is seen. With `return_error` also the
        standard error [rows, columns] float32, from the spread of independent batches of rays, 0
        where nothing is seen; infinite with a single ray. It has up to 7 degrees of freedom, and
        does not know of an occluder that no ray of the pixel has met. Two runs give the same bits.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range; the message says
            which, its value and what is allowed.
        MissingExtraError: embreex is not installed; it comes with the extra `truth`.
    """
    caster = _kept.get(scene) if isinstance(scene, Scene) else None
    if caster is None:
        caster = RayAo(scene)
        _kept[scene] = caster
    openness, error = caster(
        camera, radius, rays, weighting=weighting, attenuation=attenuation,
        target_error=target_error, estimate_error=return_error, progress=progress,
        gbuffer=gbuffer,
    )
    return (openness, error) if return_error else openness
