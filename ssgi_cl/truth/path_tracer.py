"""Paths of light through a scene, on rays that Mitsuba 3 casts and lights that it evaluates."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.camera_rays import depths_in_sphere, visibility_rays
from ssgi_cl.core.lights import Light
from ssgi_cl.core.sampling import r_points
from ssgi_cl.core.scene import Scene
from ssgi_cl.truth.mitsuba_scene import BACKLESS, GLOSS, HOLE, SIZE, SPECULAR, MitsubaScene

Doubles = NDArray[np.float64]
Floats = NDArray[np.float32]

OFFSET = 2.0**-20
"""Height above its triangle at which a ray starts, in sizes of the triangle and its coordinates:
16 roundings of float32, as in `ray_ao`."""

MOST_CROSSINGS = 1000
"""Surfaces along one path that goes through walls, at most."""

PIXELS = 1 << 20
"""Of a block of rows, traced in one go."""

PATHS = 1 << 16
"""Of all pixels, traced in one go where an image has fewer pixels."""


class Surface(NamedTuple):
    """Surface points where rays end, in Mitsuba's numbers: one of each, or an array with a lane for each ray.

    Attributes:
        there: whether the ray met something; the rest is of no use otherwise.
        point: relative to the scene's origin.
        normal: of the triangle, facing where the ray came from.
        axis: the mesh's normal on the same side.
        offset: distance from the triangle at which further rays start.
        albedo: linear reflectance.
        specular, gloss: reflectance and exponent of the Phong lobe, of tracers with lobes.
    """

    there: Any
    point: Any
    normal: Any
    axis: Any
    offset: Any
    albedo: Any
    specular: Any = 0.0
    gloss: Any = 1.0

    @property
    def front(self) -> Any:
        return self.point + self.normal * self.offset

    @property
    def behind(self) -> Any:
        return self.point - self.normal * self.offset


class PathTracer(ABC):
    """Estimates one quantity: with all pixels in a vector, or in a scalar variant one by one.

    It is made and used `within` the variant.
    """

    numbers = 0
    """Random numbers of a path, beside those of `irradiance`."""

    def __init__(
        self,
        scene: Scene,
        lights: Sequence[Light],
        variant: str,
        *,
        emission: bool = False,
        lobes: bool = False,
        blends: bool = False,
    ) -> None:
        import drjit
        import mitsuba

        self.dr: Any = drjit
        self.mi: Any = mitsuba
        self._world = MitsubaScene.of(
            scene,
            lights,
            variant,
            emission="attributes" if emission else "none",
            lobes="attributes" if lobes else "none",
            through="attributes" if blends else "none",
        )
        self.lobes = lobes
        emitters = self._world.scene.emitters()
        self._punctual_lights = [emitter for emitter in emitters if not emitter.is_environment()]
        self._sky = self._world.scene.environment()
        self.sky_numbers = 0 if self._sky is None else 4 if self._world.has_sky_image else 2
        low, high = scene.bounds - scene.origin
        self._middle, self._reach = 0.5 * (low + high), 0.51 * float(np.linalg.norm(high - low))

    @abstractmethod
    def estimate(self, seen: Surface, numbers: Sequence[Any]) -> Any:
        """Return what one path finds out about the irradiance of what is seen."""

    # ---- images

    def image(self, camera: Camera, paths: int, seed: int) -> Floats:
        """Return irradiance [rows, columns, 3] from `paths` paths a pixel."""
        image = np.zeros((camera.height, camera.width, 3), np.float32)
        height = max(1, PIXELS // camera.width)
        for first in range(0, camera.height, height):
            rows = slice(first, min(first + height, camera.height))
            start, way, length = self.view_rays(camera, rows)
            pixels = np.flatnonzero(length > 0.0)
            if not len(pixels):
                continue
            count = self.numbers + self.sky_numbers
            shift = np.random.default_rng([seed, first]).random((count, len(pixels)), np.float32)
            rays = [start[:, pixels], way[:, pixels], length[pixels], shift]
            if self.dr.is_jit_v(self.mi.Float):
                sums = self._sum(rays, paths)
            else:
                lanes = range(len(pixels))
                sums = np.stack([self._sum([a[..., i] for a in rays], paths) for i in lanes], 1)
            image[rows].reshape(-1, 3)[pixels] = (sums / paths).T
        return image

    def view_rays(self, camera: Camera, rows: slice, offset: Doubles | None = None) -> tuple[Floats, Floats, Floats]:
        """Return start [3, n], direction [3, n] and length [n] of view rays, row by row.

        `offset` [2, n] moves them from the pixels' centres, in pixels. They start and end near the
        sphere round the scene; those that can't meet it have a negative length.
        """
        start, along = visibility_rays(camera, rows, self._world.origin, offset=offset)
        near, far, _ = depths_in_sphere(camera, start, along, self._middle, self._reach)
        speed = np.linalg.norm(along, axis=-1)
        way, length = along / speed[:, None], (far - near) * speed
        start = start + near[:, None] * along
        return start.T.astype(np.float32), way.T.astype(np.float32), length.astype(np.float32)

    def together(self, pixels: int) -> int:
        """Return how many paths of each pixel are traced in one go."""
        return max(1, PATHS // pixels) if self.dr.is_jit_v(self.mi.Float) else 1

    def _sum(self, rays: Sequence[Floats], paths: int) -> Floats:
        """Return the sum of the estimates of all paths of one pixel, [3], or of n, [3, n].

        Args:
            rays: start [3], direction [3] and length [] of the view ray, and random numbers
                [count] of the pixel; or one more axis of n.
        """
        mi, dr = self.mi, self.dr
        *of_view, shift = rays
        shape, pixels = of_view[0].shape, np.size(of_view[-1])
        total = np.zeros((3, pixels), np.float32)
        together = self.together(pixels)
        times = 0
        steps = r_points(0, paths, len(shift))
        for some in np.split(steps, range(together, paths, together)):
            if len(some) != times:
                times = len(some)
                seen = self._seen(of_view, times)
            each = [np.mod(shift.T + step, 1.0).T for step in some]
            numbers = [mi.Float(number) for number in aligned(np.concatenate(each, axis=-1))]
            found = dr.select(seen.there, self.estimate(seen, numbers), 0.0)
            light = np.array(found, np.float32).reshape(3, -1)
            for one in np.split(np.broadcast_to(light, (3, times * pixels)), times, axis=1):
                total += one
        return total.reshape(shape)

    def _seen(self, of_view: Sequence[Floats], times: int) -> Surface:
        """Return what view rays meet, so many times one after the other."""
        mi, dr = self.mi, self.dr
        start, way, length = (aligned(np.concatenate([a] * times, axis=-1) if times > 1 else a)
                              for a in of_view)  # fmt: skip
        ray = mi.Ray3f(mi.Point3f(*map(mi.Float, start)), mi.Vector3f(*map(mi.Float, way)), mi.Float(length), 0.0, [])
        seen = self.surface(ray, mi.Bool(True))
        dr.eval(*seen)
        return seen

    # ---- rays

    def surface(self, ray: Any, active: Any) -> Surface:
        """Return what a ray meets first, holes aside."""
        return self.hit(ray, active)[0]

    def hit(self, ray: Any, active: Any) -> tuple[Surface, Any]:
        """Return the same with Mitsuba's record of it, a `SurfaceInteraction3f`."""
        return self.first_hit(self._past_holes(ray, active), active)

    def first_hit(self, ray: Any, active: Any) -> tuple[Surface, Any]:
        """Return the same of what a ray meets first, hole or not."""
        mi, dr = self.mi, self.dr
        si = self._world.scene.ray_intersect(ray, active)
        there = active & si.is_valid()
        size, albedo = mi.Float(0.0), mi.Color3f(0.0)
        lobe = (mi.Color3f(0.0), mi.Float(1.0)) if self.lobes else ()
        if there is not False:  # a scalar variant can't call the methods of nothing
            size = si.shape.eval_attribute_1(SIZE, si, there)
            albedo = si.bsdf().eval_diffuse_reflectance(si, there)
            if self.lobes:
                specular = mi.Color3f(si.shape.eval_attribute_3(SPECULAR, si, there))
                gloss = si.shape.eval_attribute_1(GLOSS, si, there)
                lobe = dr.minimum(specular, 1.0 - albedo), dr.maximum(gloss, 1.0)
        normal = _turned(dr, si.n, -ray.d)
        axis = si.sh_frame.n
        # Without a normal of the mesh's own: that of the triangle.
        axis = dr.select(dr.isfinite(dr.squared_norm(axis)), axis, normal)
        axis = dr.select(dr.squared_norm(axis) > 0.0, dr.normalize(axis), normal)
        axis = _turned(dr, axis, normal)
        return Surface(there, si.p, normal, axis, OFFSET * size, albedo, *lobe), si

    def _past_holes(self, ray: Any, active: Any, *, to_light: bool = False) -> Any:
        """Return the ray, started behind all holes, and backs that are not there, that it meets first.

        `to_light`: light comes the other way, and meets fronts where the ray meets backs.
        """
        if not self._world.has_holes and not self._world.culls:
            return ray
        mi, dr = self.mi, self.dr

        def step(start: Any, length: Any, searching: Any) -> tuple[Any, Any, Any]:
            si = self._world.scene.ray_intersect(mi.Ray3f(start, ray.d, length, 0.0, []), searching)
            hole = searching & si.is_valid()
            if hole is not False:
                cut = mi.Bool(False)
                if self._world.has_holes:
                    cut |= si.bsdf().eval_null_transmission(si, hole)[0] > 1.0 - HOLE
                hole &= cut | self.from_behind(si, ray.d, hole, to_light=to_light)
                size = si.shape.eval_attribute_1(SIZE, si, hole)
                behind = si.p - _turned(dr, si.n, -ray.d) * (OFFSET * size)
                start = dr.select(hole, behind, start)
                length = dr.select(hole, length - si.t, length)
            return start, length, hole

        start, length, _ = dr.while_loop(
            (mi.Point3f(ray.o), mi.Float(ray.maxt), mi.Bool(active)), lambda *state: state[2], step
        )
        return mi.Ray3f(start, ray.d, length, 0.0, [])

    def from_behind(self, si: Any, way: Any, active: Any, *, to_light: bool = False) -> Any:
        """Return whether rays meet a back that is not there; `to_light` as of `_past_holes`."""
        if not self._world.culls:
            return self.mi.Bool(False)
        along = self.dr.dot(si.n, -way if to_light else way)
        return (along > 0.0) & (si.shape.eval_attribute_1(BACKLESS, si, active) > 0.5)

    def _blocked(self, start: Any, way: Any, length: Any, active: Any, *, to_light: bool) -> Any:
        """Return whether something lies on the way."""
        ray = self._past_holes(self.mi.Ray3f(start, way, length, 0.0, []), active, to_light=to_light)
        return self._world.scene.ray_test(ray, active)

    # ---- light

    def irradiance(self, at: Surface, numbers: Sequence[Any]) -> Any:
        """Return the direct irradiance of surfaces, on the side of their normals."""
        mi, dr = self.mi, self.dr
        total = self.lamp_irradiance(at)
        if self._sky is None:
            return total
        # Cosine-distributed directions, and for an image also such as are bright (Veach and Guibas
        # 1995: both weighted by the balance heuristic).
        both = self._world.has_sky_image
        here = dr.zeros(mi.SurfaceInteraction3f)
        here.p = at.point
        way = self._cosine_distributed(at, numbers)
        cosine = self.arriving(at, way, math.inf)
        here.wi = -way
        density = cosine / math.pi
        if both:
            to = mi.DirectionSample3f()
            to.d = way
            density += self._sky.pdf_direction(here, to, at.there)
        # Nothing that counts is as improbable as this; it guards against 0 / 0 where nothing does.
        share = cosine / dr.maximum(density, 1e-20)
        total += self._sky.eval(here, at.there) * share
        if both:
            to, strength = self._sky.sample_direction(here, mi.Point2f(*numbers[2:4]), at.there)
            cosine = self.arriving(at, to.d, math.inf)
            share = to.pdf / dr.maximum(to.pdf + cosine / math.pi, 1e-20)
            total += strength * cosine * share
        return total

    def lamp_irradiance(self, at: Surface) -> Any:
        """Return the direct irradiance by punctual lights, which is exact."""
        mi, dr = self.mi, self.dr
        here = dr.zeros(mi.SurfaceInteraction3f)
        here.p = at.point
        total = mi.Color3f(0.0)
        for punctual_light in self._punctual_lights:
            to, strength = punctual_light.sample_direction(here, mi.Point2f(0.5), at.there)
            cosine = self.arriving(at, to.d, to.dist)
            # At the light itself the strength is infinite, and the cosine 0.
            total += dr.select(cosine > 0.0, strength * cosine, 0.0)
        return total

    def arriving(self, at: Surface, way: Any, distance: Any, *, to_light: bool = True) -> Any:
        """Return the cosine of a direction, or 0 where light from there does not arrive.

        It passes backs that are not there as a light or a sky sees them, or else as the surface does.
        """
        cosine, faces = self.facing(at, way)
        return self.dr.select(self._blocked(at.front, way, distance, faces, to_light=to_light), 0.0, cosine)

    def facing(self, at: Surface, way: Any) -> tuple[Any, Any]:
        """Return the cosine of a direction, 0 where it is below the surface, and where not."""
        dr = self.dr
        cosine = dr.dot(at.axis, way)
        faces = at.there & (cosine > 0.0) & (dr.dot(at.normal, way) > 0.0)
        return dr.select(faces, cosine, 0.0), faces

    def _cosine_distributed(self, at: Surface, numbers: Sequence[Any]) -> Any:
        local = self.mi.warp.square_to_cosine_hemisphere(self.mi.Point2f(*numbers[:2]))
        return self.mi.Frame3f(at.axis).to_world(local)


class DirectLight(PathTracer):
    """Light straight from lights."""

    def estimate(self, seen: Surface, numbers: Sequence[Any]) -> Any:
        return self.irradiance(seen, numbers)


class OneBounce(PathTracer):
    """Light that one surface has reflected on its way."""

    numbers = 2

    def estimate(self, seen: Surface, numbers: Sequence[Any]) -> Any:
        # pi * mean of (albedo / pi * irradiance), for the density of directions is cos / pi.
        way = self._cosine_distributed(seen, numbers)
        above = seen.there & (self.dr.dot(seen.normal, way) > 0.0)
        return self.along(seen.front, way, above, numbers[2:])

    def along(self, start: Any, way: Any, active: Any, numbers: Sequence[Any]) -> Any:
        """Return albedo times irradiance of what rays meet."""
        met = self.surface(self.mi.Ray3f(start, way, math.inf, 0.0, []), active)
        light = met.albedo * self.irradiance(met, numbers)
        return self.dr.select(met.there, light, 0.0)


class BounceWithoutVisibility(OneBounce):
    """The same, if nothing stood between that surface and what is seen."""

    def along(self, start: Any, way: Any, active: Any, numbers: Sequence[Any]) -> Any:
        mi, dr = self.mi, self.dr

        def step(start: Any, total: Any, crossed: Any, active: Any) -> tuple[Any, ...]:
            met = self.surface(mi.Ray3f(start, way, math.inf, 0.0, []), active)
            light = met.albedo * self.irradiance(met, numbers)
            total = total + dr.select(met.there, light, 0.0)
            start = dr.select(met.there, met.behind, start)
            return start, total, crossed + 1, met.there & (crossed < MOST_CROSSINGS)

        state = (mi.Point3f(start), mi.Color3f(0.0), mi.UInt32(0), mi.Bool(active))
        return dr.while_loop(state, lambda *now: now[-1], step)[1]


def aligned(array: NDArray[Any]) -> NDArray[Any]:
    """Return a copy whose rows each start at a multiple of 64 bytes.

    Mitsuba's arrays take memory as it is, and a program is compiled for each pattern of which of
    its inputs are aligned: of the same paths, several.
    """
    if np.ndim(array) == 0 or not array.size:  # of a scalar variant, or of none
        return array
    item, count = array.dtype.itemsize, array.shape[-1]
    rows = np.atleast_2d(array)
    stride = -(-count * item // 64) * 64 // item
    memory = np.empty(len(rows) * stride + 64 // item, array.dtype)
    first = -memory.ctypes.data % 64 // item
    copied = memory[first : first + len(rows) * stride].reshape(-1, stride)[:, :count]
    copied[:] = rows
    return copied[0] if array.ndim == 1 else copied


def _turned(dr: Any, normal: Any, towards: Any) -> Any:
    """Return the normal on the side of a direction."""
    return dr.select(dr.dot(normal, towards) < 0.0, -normal, normal)
