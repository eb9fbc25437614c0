"""Every technique on small inputs: the kernels that are built, as the library builds them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import ssgi_cl as gi
from ssgi_cl.device.drivers import probe_timer
from ssgi_cl.device.kernel import Kernel
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import Struct
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.tuning.calibration import Calibration

from . import every
from .drawn import polished


@dataclass(frozen=True)
class Build:
    """A kernel as it was built.

    Attributes:
        path: its file in kernels/.
        macros: name -> value, what the technique gave.
        structs: likewise.
        kernel: the result, which was launched.
    """

    path: str
    macros: Mapping[str, int]
    structs: tuple[Struct, ...]
    kernel: Kernel


@cache
def builds(runtime: Runtime, kind: str | None = None) -> tuple[Build, ...]:
    """Run every technique once and return all kernels that this built.

    With a `kind` they are those of such devices, such as "gpu", run by this one.
    """
    own = Runtime(runtime.info, runtime.variant)
    if kind is not None:
        own.info = replace(own.info, kind=kind)
    every.results(every.inputs(own, (20, 32), 16), own)
    made = BUILTIN_SCENES["cornell_box"]()
    # Lights with lobes in the occupancy grid.
    for visible in (polished(made.scene), made.scene):
        gi.render(
            visible,
            made.camera(64, 48),
            made.lights,
            ao="gtao",
            indirect="vpl",
            vpls=64,
            glossy_vpls=64 if visible is not made.scene else 0,
            rsm_size=32,
            runtime=own,
        )
    gi.render(
        polished(made.scene),
        made.camera(64, 48),
        [*made.lights, gi.Environment(1.0)],
        preset="low",
        rsm_size=32,
        runtime=own,
    )
    panes = [replace(m, transmission=(0.5,) * 3) if i % 2 else m
             for i, m in enumerate(made.scene.materials)]  # fmt: skip
    gi.render(replace(made.scene, materials=tuple(panes)), made.camera(64, 48), made.lights, bounces=0, runtime=own)
    gbuffer = gi.rasterize.gbuffer(made.scene, made.camera(64, 48), runtime=own)
    spot = next(light for light in made.lights if isinstance(light, gi.SpotLight))
    gi.vpl_splat(
        gbuffer,
        gi.rasterize.rsm(made.scene, spot, size=32, runtime=own),
        64,
        interleave=True,
        visibility=True,
        scene=made.scene,
        runtime=own,
    )
    probe_timer.timer(own)()
    Calibration.of(own)
    return tuple(
        Build(path, dict(macros), structs, kernel)
        for (path, macros, structs, *_), kernel in own.programs.kernels.items()
    )
