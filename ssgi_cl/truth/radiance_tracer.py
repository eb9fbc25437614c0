"""Paths of any number of bounces, from a camera to lights, emission and environments."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, environments_of, light_extent
from ssgi_cl.core.sampling import r_points
from ssgi_cl.core.scene import Scene
from ssgi_cl.truth.emitters import Emitters
from ssgi_cl.truth.mitsuba_scene import BLENDS, DENSITY, EMISSION, GLOW, HOLE, SIZE, TRANSMISSION
from ssgi_cl.truth.path_tracer import MOST_CROSSINGS, OFFSET, PIXELS, PathTracer, Surface, aligned
from ssgi_cl.truth.phong_bsdf import phong_direction, phong_lobe

Floats = NDArray[np.float32]

MOST_BOUNCES = 1024
"""Of a path, at most: a longer one carries nothing unless surfaces absorb nothing."""

SURE_BOUNCES = 4
"""Bounces after which Russian roulette may end a path."""

LEAST_COSINE = 1.0 / 64.0
"""Between a ray and the normal of a surface that it passes, for how far behind it goes on."""

MOST_LASTING = 0.95
"""Probability that a path goes on, at most."""


class RadianceTracer(PathTracer):
    """Estimates radiance seen through pixels.

    Each vertex takes light of punctual lights, of a point of an emissive triangle, and of an
    environment image's direction by importance; the path's next direction finds emission and
    environments too, both weighted by the balance heuristic (Veach and Guibas 1995). Directions
    are distributed by the cosine or by the surface's lobe, chosen by how much each reflects.

    A path goes through surfaces that are seen through as probably as they let light pass; on its
    way from a light to a vertex, light is dimmed by what each lets through.
    """

    def __init__(
        self,
        scene: Scene,
        lights: Sequence[Light],
        variant: str,
        *,
        bounces: int = MOST_BOUNCES,
        box_filter: bool = False,
    ) -> None:
        self._emits = any(m.emits for m in scene.used_materials)
        lobes = any(m.is_glossy for m in scene.used_materials)
        super().__init__(scene, lights, variant, emission=self._emits, lobes=lobes, blends=scene.is_seen_through)
        self._bounces = bounces
        self._box = box_filter
        self._environments = environments_of(lights)
        self._emitters = Emitters.of(scene)
        self._both = self._world.has_sky_image
        self._punctual: list[tuple[Any, Any]] = [
            (emitter, lights[int(emitter.id().removeprefix("light_"))]) for emitter in self._punctual_lights
        ]
        self._soft = any(light_extent(light) > 0.0 for _, light in self._punctual)
        names = ("corner", "first", "second", "radiance", "cumulative", "density", "backless")
        jit = self.dr.is_jit_v(self.mi.Float)
        self._tables = {name: self.mi.Float(np.float32(getattr(self._emitters, name)).ravel()) for name in names if jit}
        # Continuation, environment image, emission, place in the pixel.
        self.numbers = 2 + 2 * self._both + 3 * (len(self._emitters) > 0) + 2 * box_filter

    def estimate(self, seen: Surface, numbers: Sequence[Any]) -> Any:
        raise NotImplementedError("radiance is estimated from rays: expected a call of image")

    # ---- images

    def image(self, camera: Camera, paths: int, seed: int) -> Floats:
        """Return radiance [rows, columns, 3] from `paths` paths a pixel."""
        image = np.zeros((camera.height, camera.width, 3), np.float32)
        height = max(1, PIXELS // camera.width)
        for first in range(0, camera.height, height):
            rows = slice(first, min(first + height, camera.height))
            count = (rows.stop - rows.start) * camera.width
            shift = np.random.default_rng([seed, first]).random((self.numbers, count))
            labels = np.arange(first * camera.width, first * camera.width + count)
            steps = r_points(0, paths, self.numbers)
            total = np.zeros((3, count))
            together = self.together(count)
            for begin in range(0, paths, together):
                numbers = np.mod(shift + steps[begin : begin + together, :, None], 1.0)
                path = seed * paths + begin + np.arange(len(numbers))
                rays = self._view_rays(camera, rows, numbers)
                found = self._radiance(
                    rays,
                    np.hstack([*numbers.astype(np.float32)]),
                    np.tile(labels, len(path)),
                    np.repeat(path, count).astype(np.uint32),
                )
                for one in np.split(found, len(path), axis=1):
                    total += one
            image[rows] = (total / paths).T.reshape(-1, camera.width, 3)
        return image

    def _view_rays(self, camera: Camera, rows: slice, numbers: NDArray[np.float64]) -> tuple[Floats, ...]:
        """Return start, direction and length of view rays, path by path: `numbers` [paths, ...]."""
        if self._box:
            each = [self.view_rays(camera, rows, one[-2:] - 0.5) for one in numbers]
        else:
            each = [self.view_rays(camera, rows)] * len(numbers)
        return tuple(np.concatenate(parts, axis=-1) for parts in zip(*each, strict=True))

    def _radiance(
        self, rays: Sequence[Floats], numbers: Floats, labels: NDArray[np.int64], path: NDArray[np.uint32]
    ) -> Floats:
        """Return what each of n paths finds, [3, n].

        Args:
            rays: start, direction and length of view rays.
            numbers: [count, n] in [0, 1): of the first vertex.
            labels: [n] of the pixels, with `path` [n] the seed of all further random numbers.
        """
        if self.dr.is_jit_v(self.mi.Float):
            given = [aligned(a) for a in (*rays, numbers, labels.astype(np.uint32), path)]
            found, there, dimmed = self._traced(given[:3], *given[3:])
        else:
            each = [
                self._traced([a[..., i] for a in rays], numbers[:, i], int(labels[i]), int(path[i]))
                for i in range(len(labels))
            ]
            found, there, dimmed = (np.concatenate([one[i] for one in each], axis=-1) for i in range(3))
        return np.where(there, found, environment_radiance(self._environments, rays[1]) * dimmed)

    def _traced(
        self, rays: Sequence[Floats], numbers: Floats, label: Any, path: Any
    ) -> tuple[Floats, NDArray[np.bool_], Floats]:
        """Return radiance of surfaces [3, n], where there are any [n], and the weight [3, n] that
        what is behind all surfaces has."""
        mi, dr = self.mi, self.dr
        start, way, length = rays
        reach = mi.Float(length)
        ray = mi.Ray3f(mi.Point3f(*map(mi.Float, start)), mi.Vector3f(*map(mi.Float, way)), reach, 0.0, [])
        rng = mi.PCG32()
        rng.seed(*mi.sample_tea_32(mi.UInt32(label), mi.UInt32(path)))
        seen, si, dimmed, rng = self._met(ray, mi.Bool(reach > 0.0), rng)
        light = self._path(seen, mi.Vector3f(ray.d), [mi.Float(row) for row in numbers], rng)
        light = dr.select(seen.there, light + self._emission(seen, si)[0], 0.0) * dimmed
        there, dimmed = mi.Bool(seen.there), mi.Color3f(dimmed)
        dr.eval(light, there, dimmed)
        found, share = (np.array(a, np.float32).reshape(3, -1) for a in (light, dimmed))
        return found, np.array(there).reshape(-1), share

    # ---- paths

    def _path(self, seen: Surface, way: Any, numbers: Sequence[Any], rng: Any) -> Any:
        """Return radiance that surfaces reflect to the eye, from where rays go this `way`."""
        mi, dr = self.mi, self.dr
        # What still arrives at the last vertex straight from emission and environments is found
        # by one more direction.
        onward = self._emits or self._sky is not None
        fields = 8 if self.lobes else 6

        def step(depth: Any, total: Any, weight: Any, active: Any, rng: Any, way: Any, *fields_: Any) -> Any:
            at = Surface(active, *fields_)
            own = [dr.select(depth == 0, number, rng.next_float32()) for number in numbers]
            mirrored = self._mirrored(at, way)
            place = (rng.next_float32(), rng.next_float32()) if self._soft else None
            light = self._by_punctual_lights(at, mirrored, place)
            pairs = iter(own[2:])
            if self._both:
                light += self._by_environment(at, mirrored, next(pairs), next(pairs))
            if len(self._emitters):
                light += self._by_emitters(at, mirrored, next(pairs), next(pairs), next(pairs))
            total += dr.select(active, weight * light, 0.0)
            chosen = rng.next_float32() if self.lobes else mi.Float(1.0)
            way = self._onward(at, mirrored, own, chosen)
            cosine = dr.dot(at.axis, way)
            active &= (dr.dot(at.normal, way) > 0.0) & (cosine > 0.0)
            density = self._density(at, mirrored, way, cosine)
            reflected = self._reflected(at, mirrored, way, cosine)
            weight = weight * reflected
            # A path that has ended must not grow without bounds beside those that go on.
            weight = dr.select(active & (density > 0.0), weight / density, 0.0)
            # Russian roulette by what the path still carries.
            lasting = dr.minimum(dr.max(weight), MOST_LASTING)
            lasting = dr.select(depth < SURE_BOUNCES, 1.0, lasting)
            goes_on = depth < self._bounces
            lasting = dr.select(goes_on, lasting, 1.0)
            active &= (dr.max(weight) > 0.0) & (rng.next_float32() < lasting)
            if not onward:
                active &= goes_on
            weight = weight / dr.maximum(lasting, 1e-30)
            met, si, dimmed, rng = self._met(mi.Ray3f(at.front, way, math.inf, 0.0, []), active, rng)
            weight = weight * dimmed
            if self._sky is not None:
                escapes, share = dr.select(met.there, False, active), mi.Color3f(1.0)
                if self._world.culls:
                    share = self._sky_share(at, mirrored, way, cosine, reflected, active, escapes)
                    escapes = active
                total += weight * share * self._environment(at, way, density, escapes)
            if self._emits:
                total += weight * self._met_emission(at, met, si, way, density)
            active &= met.there & goes_on
            return depth + 1, total, weight, active, rng, way, *met[1:fields]

        state = (mi.UInt32(0), mi.Color3f(0.0), mi.Color3f(1.0), mi.Bool(seen.there), rng, way, *seen[1:fields])
        return dr.while_loop(state, lambda *now: now[3], step)[1]

    # ---- surfaces that are seen through

    def _met(self, ray: Any, active: Any, rng: Any) -> tuple[Surface, Any, Any, Any]:
        """Return what `hit` does, a weight, and the generator after what it was asked for: rays
        pass what is seen through by chance."""
        if not self._world.blends:
            return *self.hit(ray, active), 1.0, rng
        mi, dr = self.mi, self.dr

        def step(start: Any, length: Any, weight: Any, crossed: Any, searching: Any, rng: Any) -> Any:
            found, opacity, through, behind = self._crossed(start, ray.d, length, searching, to_light=False)
            share = dr.max(through)
            passes = found & (rng.next_float32() < share)
            kept = dr.select(passes, through / dr.maximum(share, 1e-20), opacity / dr.maximum(1.0 - share, 1e-20))
            weight = dr.select(found, weight * kept, weight)
            start = dr.select(passes, start + behind * ray.d, start)
            length = dr.select(passes, length - behind, length)
            return start, length, weight, crossed + 1, passes & (crossed < MOST_CROSSINGS), rng

        start, length, weight, _, _, rng = dr.while_loop(
            (mi.Point3f(ray.o), mi.Float(ray.maxt), mi.Color3f(1.0), mi.UInt32(0),
             mi.Bool(active), rng),
            lambda *state: state[4], step,
        )  # fmt: skip
        return *self.first_hit(mi.Ray3f(start, ray.d, length, 0.0, []), active), weight, rng

    def _crossed(self, start: Any, way: Any, length: Any, active: Any, *, to_light: bool) -> tuple[Any, ...]:
        """Return whether a ray meets anything, which share of that surface is there, the share of
        light [3] that passes, and the distance of the point behind; `to_light` as of `_past_holes`."""
        mi, dr = self.mi, self.dr
        si = self._world.scene.ray_intersect(mi.Ray3f(start, way, length, 0.0, []), active)
        found = active & si.is_valid()
        opacity, through, behind = mi.Float(1.0), mi.Color3f(0.0), mi.Float(0.0)
        if found is not False:
            opacity = 1.0 - si.bsdf().eval_null_transmission(si, found)[0]
            blends = si.shape.eval_attribute_1(BLENDS, si, found) > 0.5
            opacity = dr.select(blends, opacity, dr.select(opacity < HOLE, 0.0, 1.0))
            opacity = dr.select(self.from_behind(si, way, found, to_light=to_light), 0.0, opacity)
            own = mi.Color3f(si.shape.eval_attribute_3(TRANSMISSION, si, found))
            through = (1.0 - opacity) + opacity * own
            size = si.shape.eval_attribute_1(SIZE, si, found)
            # Along the ray, lest it end behind what it just reached: a light on a surface.
            passed = OFFSET * size / dr.maximum(dr.abs(dr.dot(si.n, way)), LEAST_COSINE)
            behind = si.t + passed
        return found, opacity, through, behind

    def _arriving(self, at: Surface, way: Any, distance: Any, *, to_light: bool = True) -> tuple[Any, Any]:
        """Return what `arriving` does, and the share of the light that is let through."""
        if not self._world.blends:
            return self.arriving(at, way, distance, to_light=to_light), 1.0
        mi, dr = self.mi, self.dr
        cosine, faces = self.facing(at, way)

        def step(start: Any, length: Any, weight: Any, searching: Any) -> Any:
            found, _, through, behind = self._crossed(start, way, length, searching, to_light=to_light)
            weight = dr.select(found, weight * through, weight)
            start = dr.select(found, start + behind * way, start)
            length = dr.select(found, length - behind, length)
            return start, length, weight, found & (dr.max(weight) > 0.0)

        state = (mi.Point3f(at.front), mi.Float(distance), mi.Color3f(1.0), mi.Bool(faces))
        weight = dr.while_loop(state, lambda *now: now[3], step)[2]
        return dr.select(dr.max(weight) > 0.0, cosine, 0.0), weight

    # ---- reflection

    def _mirrored(self, at: Surface, way: Any) -> Any:
        """Return the axis of the lobe of surfaces that rays meet this `way`."""
        return way - at.axis * (2.0 * self.dr.dot(at.axis, way)) if self.lobes else None

    def _lobe(self, at: Surface, mirrored: Any, way: Any) -> Any:
        """Return the lobe's value, per solid angle; it integrates to 1 over the sphere."""
        return phong_lobe(self.dr, self.dr.dot(mirrored, way), at.gloss)

    def _share(self, at: Surface) -> Any:
        """Return the probability of a direction within the lobe."""
        dr = self.dr
        return dr.max(at.specular) / dr.maximum(dr.max(at.specular) + dr.max(at.albedo), 1e-20)

    def _reflected(self, at: Surface, mirrored: Any, way: Any, cosine: Any, mirrors: Any = True) -> Any:
        """Return radiance reflected to the eye over radiance from a direction, per solid angle.

        `cosine` is the direction's, 0 where nothing arrives from there; lobes reflect where it
        `mirrors`, by default wherever anything arrives.
        """
        diffuse = at.albedo * (cosine / math.pi)
        if not self.lobes:
            return diffuse
        sees = cosine > 0.0 if mirrors is True else mirrors
        lobe = self.dr.select(sees, self._lobe(at, mirrored, way), 0.0)
        return diffuse + at.specular * lobe

    def _density(self, at: Surface, mirrored: Any, way: Any, cosine: Any) -> Any:
        """Return the probability of `_onward`'s directions, per solid angle; 0 for cosine 0."""
        if not self.lobes:
            return cosine / math.pi
        share = self._share(at)
        lobe = self.dr.select(cosine > 0.0, self._lobe(at, mirrored, way), 0.0)
        return (1.0 - share) * (cosine / math.pi) + share * lobe

    def _onward(self, at: Surface, mirrored: Any, numbers: Sequence[Any], chosen: Any) -> Any:
        """Return a direction by which a path goes on, which may lie below the surface."""
        way = self._cosine_distributed(at, numbers)
        if not self.lobes:
            return way
        within = phong_direction(self.mi, mirrored, at.gloss, numbers[0], numbers[1])
        return self.dr.select(chosen < self._share(at), within, way)

    # ---- light

    def _by_punctual_lights(self, at: Surface, mirrored: Any, place: Any) -> Any:
        """Return the radiance reflected of punctual lights.

        Those with a size shine from their middle, and are hidden as a point of their disc is, which
        faces what they shine on: `place` has two numbers in [0, 1) for it.
        """
        if not self.lobes and not self._soft and not self._world.blends:
            return at.albedo * (self.lamp_irradiance(at) / math.pi)
        mi, dr = self.mi, self.dr
        here = dr.zeros(mi.SurfaceInteraction3f)
        here.p = at.point
        total = mi.Color3f(0.0)
        for emitter, light in self._punctual:
            to, strength = emitter.sample_direction(here, mi.Point2f(0.5), at.there)
            way, distance = to.d, to.dist
            extent = light_extent(light)
            if extent > 0.0:
                parallel = isinstance(light, DirectionalLight)
                point = mi.warp.square_to_uniform_disk(mi.Point2f(*place)) * extent
                frame = mi.Frame3f(to.d)
                aside = frame.s * point.x + frame.t * point.y
                way = to.d * (1.0 if parallel else to.dist) + aside
                length = dr.norm(way)
                way = way / length
                distance = to.dist if parallel else length
            arriving, through = self._arriving(at, way, distance)
            cosine = dr.select(arriving > 0.0, dr.maximum(dr.dot(at.axis, to.d), 0.0), 0.0)
            reflected = self._reflected(at, mirrored, to.d, cosine) * through
            total += dr.select(cosine > 0.0, strength * reflected, 0.0)
        return total

    def _by_environment(self, at: Surface, mirrored: Any, u: Any, v: Any) -> Any:
        """Return radiance reflected of a direction that an environment image is bright in."""
        mi, dr = self.mi, self.dr
        here = dr.zeros(mi.SurfaceInteraction3f)
        here.p = at.point
        to, strength = self._sky.sample_direction(here, mi.Point2f(u, v), at.there)
        cosine, through = self._arriving(at, to.d, math.inf)
        mirrors, facing = True, cosine
        if self._world.culls:
            mirrors = self._arriving(at, to.d, math.inf, to_light=False)[0] > 0.0
            facing = self.facing(at, to.d)[0]
        density = self._density(at, mirrored, to.d, facing)
        share = to.pdf / dr.maximum(to.pdf + density, 1e-20)
        return strength * self._reflected(at, mirrored, to.d, cosine, mirrors) * share * through

    def _sky_share(
        self, at: Surface, mirrored: Any, way: Any, cosine: Any, reflected: Any, active: Any, escapes: Any
    ) -> Any:
        """Return the share [3] of what is reflected from a direction that the sky there takes part in.

        Matt surfaces are lit past backs that a sky sees, as by a light; lobes show what is seen: that
        of rays that escape.
        """
        lit = self._arriving(at, way, math.inf)[0] > 0.0
        arrived = self._reflected(at, mirrored, way, self.dr.select(lit & active, cosine, 0.0), escapes)
        return arrived / self.dr.maximum(reflected, 1e-30)

    def _environment(self, at: Surface, way: Any, density: Any, escapes: Any) -> Any:
        """Return radiance of the environment along a direction of that density, weighted."""
        mi, dr = self.mi, self.dr
        here = dr.zeros(mi.SurfaceInteraction3f)
        here.p, here.wi = at.point, -way
        share = mi.Float(1.0)
        if self._both:
            to = mi.DirectionSample3f()
            to.d = way
            other = self._sky.pdf_direction(here, to, escapes)
            share = density / dr.maximum(density + other, 1e-20)
        return dr.select(escapes, self._sky.eval(here, escapes) * share, 0.0)

    def _by_emitters(self, at: Surface, mirrored: Any, u: Any, v: Any, w: Any) -> Any:
        """Return radiance reflected of a point of an emissive triangle."""
        mi, dr = self.mi, self.dr
        index = self._emitter_index(w)
        corner, first, second, radiance = (self._row(name, index) for name in ("corner", "first", "second", "radiance"))
        place = mi.warp.square_to_uniform_triangle(mi.Point2f(u, v))
        point = mi.Point3f(corner + place.x * first + place.y * second)
        normal = dr.normalize(mi.Vector3f(dr.cross(first, second)))
        size = dr.maximum(dr.max(dr.abs(first)), dr.max(dr.abs(second))) + dr.max(dr.abs(point))
        side = dr.select(dr.dot(normal, at.point - point) < 0.0, -1.0, 1.0)
        to = point + normal * (side * OFFSET * size) - at.front
        squared = dr.maximum(dr.squared_norm(to), 1e-30)
        distance = dr.sqrt(squared)
        way = to / distance
        cosine, through = self._arriving(at, way, distance, to_light=False)
        if self._emitters.backless.any():
            seen_front = (side > 0.0) | (self._entry("backless", index) < 0.5)
            cosine = dr.select(seen_front, cosine, 0.0)
        density = self._density(at, mirrored, way, cosine)
        n_dot_w = dr.abs(dr.dot(normal, way))
        own = self._entry("density", index) * squared / dr.maximum(n_dot_w, 1e-12)
        reflected = self._reflected(at, mirrored, way, cosine) * through
        return radiance * reflected / dr.maximum(own + density, 1e-30)

    def _met_emission(self, at: Surface, met: Surface, si: Any, way: Any, density: Any) -> Any:
        """Return emission of a surface met along a direction of that density, weighted."""
        dr = self.dr
        radiance, own = self._emission(met, si)
        n_dot_w = dr.maximum(dr.abs(dr.dot(met.normal, way)), 1e-12)
        own = own * dr.squared_norm(met.point - at.front) / n_dot_w
        share = density / dr.maximum(density + own, 1e-30)
        return dr.select(met.there, radiance * share, 0.0)

    def _emission(self, met: Surface, si: Any) -> tuple[Any, Any]:
        """Return radiance of what a ray meets, and the density of `_by_emitters` there."""
        mi = self.mi
        if not self._emits or met.there is False:
            return mi.Color3f(0.0), mi.Float(0.0)
        radiance = mi.Color3f(si.shape.eval_attribute_3(EMISSION, si, met.there))
        if self._world.glows:
            radiance *= mi.Color3f(si.shape.eval_attribute_3(GLOW, si, met.there))
        return (radiance, mi.Float(si.shape.eval_attribute_1(DENSITY, si, met.there)))

    def _emitter_index(self, number: Any) -> Any:
        """Return the triangle that a random number falls to."""
        mi, dr = self.mi, self.dr
        last = len(self._emitters) - 1
        if not dr.is_jit_v(mi.Float):
            return min(int(np.searchsorted(self._emitters.cumulative, number, "right")), last)
        found = dr.binary_search(0, last, lambda i: self._entry("cumulative", i) <= number)
        return dr.minimum(found, last)

    def _entry(self, name: str, index: Any) -> Any:
        """Return a number of the emissive triangle `index`."""
        if name in self._tables:
            return self.dr.gather(self.mi.Float, self._tables[name], index)
        return float(getattr(self._emitters, name)[index])

    def _row(self, name: str, index: Any) -> Any:
        """Return a vector of the emissive triangle `index`."""
        if name in self._tables:
            return self.dr.gather(self.mi.Vector3f, self._tables[name], index)
        return self.mi.Vector3f(*getattr(self._emitters, name)[index])


def environment_radiance(environments: Sequence[Environment], way: Floats) -> Floats:
    """Return the radiance [3, n] of environments in directions [3, n], texel by texel."""
    total = np.zeros(way.shape)
    for environment in environments:
        image = np.asarray(environment.radiance)
        if image.ndim == 1:
            total += image[:, None]
            continue
        rows, columns = image.shape[:2]
        x, y, z = way.astype(np.float64)
        azimuth, polar = np.arctan2(x, -z), np.arccos(np.clip(y, -1.0, 1.0))
        column = np.clip((azimuth / (2.0 * np.pi) + 0.5) * columns, 0, columns - 1).astype(int)
        row = np.clip(polar / np.pi * rows, 0, rows - 1).astype(int)
        total += image[row, column].T
    return total.astype(np.float32)
