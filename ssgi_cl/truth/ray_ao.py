"""Ambient occlusion from rays against the mesh: slow, and as exact as one has time for."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Literal, TypedDict, Unpack, overload
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.sampling import basis, directions, hashed, r2_points, wrapped
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.progress import Progress, Told, told
from ssgi_cl.truth.raycast import RayCaster, Spots, check_gbuffer

Doubles = NDArray[np.float64]
Floats = NDArray[np.float32]

WEIGHTINGS = ("cosine", "uniform")
ATTENUATIONS = ("none", "linear", "quadratic", "exponential")

MOST_RAYS = 1 << 20
"""Rays per pixel, at most."""

BATCHES = 8
"""Independent sets of rays of a pixel, whose spread tells the error. More tell it better and make
it greater: at 256 rays in cornell_box and hall, 1, 2, 4, 8 and 16 sets have an RMSE in the ratio
1 : 1.24 : 1.34 : 1.7 : 1.95."""

BLOCK_PIXELS = 8192
"""Of a block, the unit of work of a thread."""
BLOCK_RAYS = 1 << 18
"""Traced in one go; more of them leave the cache."""
_FIRST_LOOK = 4  # rays of each batch before the error is first compared with the target
_GROWTH = 1.5  # of the number of rays from one such look to the next


class RayAo:
    """Ambient occlusion of a scene from rays, prepared for many cameras.

    Zhukov, Iones and Kronin 1998. Departs: see `ray_ao`.

    Args:
        scene: triangles; copied, so that the scene itself need not be kept.

    Raises:
        TypeError: not a scene.
        MissingExtraError: embreex is not installed.
    """

    def __init__(self, scene: Scene) -> None:
        self._caster = RayCaster(scene)

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
        progress: Progress = None,
        gbuffer: GBuffer | None = None,
        seed: int = 0,
    ) -> tuple[Floats, Floats]:
        """Return A and its standard error, [rows, columns] float32 each; see `ray_ao`.

        Without `estimate_error` (and without a target) all rays are one batch: the error is then
        smaller, but unknown, and infinite wherever something is seen.
        """
        split = estimate_error or target_error is not None
        settings = Settings.of(radius, rays, weighting, attenuation, target_error, seed, split)
        if not isinstance(camera, Camera):
            raise TypeError(f"camera is {camera!r}: expected an ssgi_cl.Camera")
        check_gbuffer(gbuffer, camera)
        rows, columns = camera.size
        visibility = np.ones((rows, columns), np.float32)
        error = np.zeros((rows, columns), np.float32)

        def work(block: slice) -> None:
            spots = self._caster.spots(camera, block, gbuffer)
            if len(spots.pixel):
                occluded, deviation = self.occlusion(spots, settings)
                visibility.ravel()[spots.pixel] = np.clip(1.0 - occluded, 0.0, 1.0)
                error.ravel()[spots.pixel] = deviation

        with told(progress, "rays") as tell:
            in_blocks((rows, columns), work, tell)
        return visibility, error

    def occlusion(self, spots: Spots, settings: Settings) -> tuple[Doubles, Doubles]:
        """Return the occluded share of each spot and its standard error."""
        count, batches = len(spots.pixel), settings.batches
        shift = _shifts(spots.pixel, batches, settings.seed)
        sums = np.zeros((batches, count))
        step = max(1, BLOCK_RAYS // (batches * count))
        start = np.tile(spots.start, (step * batches, 1))
        axes = basis(spots.axis)
        done = 0
        for level in settings.levels:
            for first in range(done, level, step):
                point = r2_points(first, min(first + step, level))
                u = wrapped(point[:, 0, None, None] + shift[None, :batches])
                v = wrapped(point[:, 1, None, None] + shift[None, batches:])
                way = directions(u, v, axes, settings.weighting)
                below = np.einsum("kbnd,nd->kbn", way, spots.normal) <= 0.0
                weight = self._weights(start[: u.size], way.reshape(-1, 3), below.ravel(), settings)
                sums += weight.reshape(u.shape).sum(axis=0)
            done = level
            mean, deviation = _mean_and_error(sums / level)
            if (
                settings.target is not None
                and level >= _FIRST_LOOK
                and (math.sqrt(float(np.mean(deviation**2))) <= settings.target)
            ):
                break
        return mean, deviation

    def _weights(self, start: Floats, way: Floats, below: NDArray[np.bool_], settings: Settings) -> Floats:
        """Return V * W of each ray; those that start into the surface meet it at distance 0."""
        reach = np.float32(settings.radius * self._caster.scale)
        reaches = np.where(below, np.float32(-1.0), reach)  # negative: not traced
        if settings.curve is None:
            blocked = self._caster.blocked(start, way, reaches)
            weight: Floats = (blocked | below).astype(np.float32)
            return weight
        distance = self._caster.distance(start, way, reaches)
        share = np.where(below, np.float32(0.0), distance / reach)
        weight = settings.curve(np.clip(share, 0.0, 1.0)).astype(np.float32)
        weight[~below & (distance >= reach)] = 0.0
        return weight


@dataclass(frozen=True, eq=False)
class Settings:
    """Arguments of `ray_ao`, checked."""

    radius: float
    batches: int
    levels: tuple[int, ...]
    """Numbers of rays of each batch at which the error is estimated; the last one ends."""
    weighting: str
    curve: Callable[[Floats], Floats] | None
    target: float | None
    seed: int

    @classmethod
    def of(
        cls,
        radius: object,
        rays: object,
        weighting: object,
        attenuation: str | ArrayLike,
        target_error: object,
        seed: object,
        split: bool,
    ) -> Settings:
        reach = checks.number("radius", radius, low=0, above=True, unit="scene units", infinite=True)
        count = checks.integer("rays", rays, low=1, high=MOST_RAYS, unit="rays per pixel")
        batches = min(BATCHES, max(math.isqrt(count), min(count, 2))) if split else 1
        last = count // batches
        levels: list[int] = []
        target = None
        if target_error is not None:
            target = checks.number("target_error", target_error, low=0, high=1, unit="of A")
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
        weighting = checks.choice("weighting", weighting, WEIGHTINGS)
        start = checks.integer("seed", seed, low=0, high=2**63 - 1)
        return cls(reach, batches, (*levels, last), weighting, curve, target, start)


def _curve(attenuation: str | ArrayLike) -> Callable[[Floats], Floats] | None:
    """Return W as a function of the distance in radii, or None where it is 1."""
    if not isinstance(attenuation, str):
        values = checks.vector("attenuation", attenuation, np.size(attenuation))
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
    return curves[checks.choice("attenuation", attenuation, ATTENUATIONS)]


def _shifts(pixel: NDArray[np.int64], batches: int, seed: int) -> Floats:
    """Return [2 * batches, n] numbers in [0, 1): the same for the same pixel.

    Each pixel's and batch's points are moved by two of them round the unit square (Cranley and
    Patterson 1976), which keeps them well spread and makes the mean of each batch unbiased.
    """
    number = pixel.astype(np.uint64)[None, :] * np.uint64(2 * BATCHES)
    return hashed(number + np.arange(2 * batches, dtype=np.uint64)[:, None], seed)


def _mean_and_error(batches: Doubles) -> tuple[Doubles, Doubles]:
    """Return mean [n] of independent estimates [batches, n] and its standard error."""
    mean: Doubles = batches.mean(axis=0)
    if len(batches) < 2:
        return mean, np.full_like(mean, np.inf)
    deviation: Doubles = batches.std(axis=0, ddof=1) / math.sqrt(len(batches))
    return mean, deviation


def in_blocks(size: tuple[int, int], work: Callable[[slice], None], tell: Told | None = None) -> None:
    """Call `work` with blocks of the rows of an image of a size (rows, columns), in threads."""
    rows, columns = size
    height = max(1, BLOCK_PIXELS // columns)
    blocks = [slice(first, min(first + height, rows)) for first in range(0, rows, height)]
    with ThreadPoolExecutor(threads()) as pool:
        for block, _ in zip(blocks, pool.map(work, blocks), strict=True):
            if tell is not None:
                tell(block.stop / rows)


def threads() -> int:
    """Return how many threads this process may run at once."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


_kept: WeakKeyDictionary[Scene, RayAo] = WeakKeyDictionary()


class _Options(TypedDict, total=False):
    weighting: str
    attenuation: str | ArrayLike
    target_error: float | None
    progress: Progress
    gbuffer: GBuffer | None
    seed: int


@overload
def ray_ao(
    scene: Scene,
    camera: Camera,
    radius: float = 0.5,
    rays: int = 256,
    *,
    return_error: Literal[False] = False,
    **options: Unpack[_Options],
) -> Floats: ...


@overload
def ray_ao(
    scene: Scene,
    camera: Camera,
    radius: float = 0.5,
    rays: int = 256,
    *,
    return_error: Literal[True],
    **options: Unpack[_Options],
) -> tuple[Floats, Floats]: ...


@checked_keywords
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
    progress: Progress = None,
    gbuffer: GBuffer | None = None,
    seed: int = 0,
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

    Monte Carlo integration of ambient occlusion as defined by Zhukov, Iones and Kronin 1998, "An
    Ambient Light Illumination Model". Departs: W is a falloff with distance that the caller
    chooses; points are a low-discrepancy sequence moved from pixel to pixel (Cranley and Patterson
    1976).

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
        progress: called with the share that is done, which grows to 1. True: a bar in terminals and notebooks.
        gbuffer: take visible points and normals from this G-buffer of the same scene and camera
            instead of from rays; the mesh is looked for within 1e-4 of its depth. Where it has no
            normals, the triangles' are used.
        seed: 0 to 2^63 - 1; another one moves every pixel's rays at random, so that results of
            different seeds are independent.

    Returns:
        A [rows, columns] float32 in [0, 1], 1 where nothing is seen. With `return_error` also the
        standard error [rows, columns] float32, from the spread of independent batches of rays, 0
        where nothing is seen; infinite with a single ray. It has up to 7 degrees of freedom, and
        does not know of an occluder that no ray of the pixel has met. Two runs give bit-identical
        results.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range; the message says
            which, its value and what is allowed.
        MissingExtraError: embreex is not installed; it comes with the extra `truth`.
    """
    caster = _kept.get(scene) if isinstance(scene, Scene) else None
    if caster is None:
        caster = RayAo(scene)
        _kept[scene] = caster
    visibility, error = caster(
        camera,
        radius,
        rays,
        weighting=weighting,
        attenuation=attenuation,
        target_error=target_error,
        estimate_error=return_error,
        progress=progress,
        gbuffer=gbuffer,
        seed=seed,
    )
    return (visibility, error) if return_error else visibility
