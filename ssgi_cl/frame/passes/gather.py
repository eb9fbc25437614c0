"""Pass: the final gather of the light that surfaces reflect and emit."""

from __future__ import annotations

from functools import cache

from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.passes import resources as of
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.stage import Declared, Stage
from ssgi_cl.rasterize.raster.view import device_scene
from ssgi_cl.techniques.filters.bilateral import Bilateral, BilateralParams
from ssgi_cl.techniques.multires.multires_splat import MultiresSplat, MultiresSplatParams
from ssgi_cl.techniques.occupancy.occupancy_grid import MOST_CELLS, Occupancy
from ssgi_cl.techniques.occupancy.scene_rays import rays_carry_first_bounce, rays_meet_triangles
from ssgi_cl.techniques.radiosity.surfel_history import STEADY_LIGHTS

SURFEL_CAPACITY = 3
"""Most lights that radiosity returns, as a multiple of the surfels asked for; of a sequence `STEADY_LIGHTS`."""
GRAIN = BilateralParams(radius=4, sigma=2.5)
"""The blur of what rays find: points of small surfaces and along edges have few rays, whose grain showed as dots."""
SMALL, SMALL_GRAIN = 256, BilateralParams(radius=2, sigma=1.0)
"""Columns of images below which it is narrower: a pixel there shows more of what changes. At 64 x 48 the brightest
twentieth of blocks of 4 x 4 pixels is 10 % too bright in a room with a spot light, with the wide blur 13 %."""


def gather(build: Build) -> Stage:
    """Return the pass: virtual point lights carry the first bounce of punctual lights where triangles
    are few, surfels all else."""
    whole, runtime = build.whole, build.runtime
    splat = MultiresSplat(
        runtime,
        build.size,
        MultiresSplatParams(
            vpls=whole.vpls, visibility=True, grid=MOST_CELLS, interpolation_error=whole.error, light_error=whole.error
        ),
        surfels=(STEADY_LIGHTS if build.history else SURFEL_CAPACITY) * whole.surfels,
        rays=whole.rays,
    )
    smooth = cache(lambda: Bilateral(runtime, build.size, GRAIN if build.size[1] >= SMALL else SMALL_GRAIN, 3))

    def run(r: Declared) -> tuple[Plane, Occupancy | None]:
        maps, seen, casting = r[of.RSM], r[of.GBUFFER], r[of.CASTING]
        exact = rays_meet_triangles(casting)
        even = r[of.EVEN_LIGHT] if exact else None
        found = splat.gather(
            seen,
            rsms=[] if maps is None or rays_carry_first_bounce(casting) else [maps],
            scene=None if exact else device_scene(casting, runtime),
            blockers=casting if exact else None,
            surfels=None if exact else r[of.SURFELS],
            even=even,
            other_light=[plane for plane in (r[of.SKY_LIGHT], r[of.DIRECT]) if plane is not None],
            # Lights that are chosen for a view are others in the next one.
            order=r[of.SURFEL_HISTORY].order if build.history and exact else None,
        )
        blocked = found.occupancy
        if blocked is None and seen.mirrors and not exact:
            blocked = splat.block(seen, casting)
        return found.irradiance if even is None else smooth().run(seen, found.irradiance), blocked

    earlier = (of.SURFEL_HISTORY,) if build.history else ()
    return Stage(
        name="bounce",
        reads=(of.GBUFFER, of.CASTING, of.LIGHTS, of.SURFELS, of.EVEN_LIGHT, of.SKY_LIGHT, of.DIRECT, *earlier),
        hints=(of.RSM,),
        writes=(of.INDIRECT, of.OCCUPANCY),
        run=run,
    )
