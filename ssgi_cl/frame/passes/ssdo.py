"""Pass: directional occlusion, which lights and occludes in one."""

from __future__ import annotations

from ssgi_cl.device.arrays import Plane
from ssgi_cl.frame.auxiliary_views import AuxiliaryViews
from ssgi_cl.frame.passes import resources as of
from ssgi_cl.frame.passes.build import Build
from ssgi_cl.frame.stage import Declared, Stage


def ssdo(build: Build) -> Stage:
    """Return the pass."""
    technique, count = build.ssdo, build.params.auxiliary_cameras
    assert technique is not None  # noqa: S101  the frame is lit by it
    views = AuxiliaryViews(build.runtime, count) if count else None

    def run(r: Declared) -> tuple[Plane | None, Plane | None]:
        technique.params = r[of.INDIRECT_PARAMS]
        seen, lights = r[of.GBUFFER], r[of.LIGHTS]
        extra = views.drawn(r[of.CASTING], r[of.CAMERA], seen, lights) if views is not None else ()
        found = technique.run(seen, lights, shadows=r[of.SHADOWS], auxiliary_views=extra)
        return found.direct, found.bounce

    return Stage(
        name="ssdo",
        reads=(of.GBUFFER, of.CASTING, of.CAMERA, of.LIGHTS, of.SHADOWS, of.INDIRECT_PARAMS),
        hints=(of.AO,),
        writes=(of.DIRECT, of.INDIRECT),
        run=run,
    )
