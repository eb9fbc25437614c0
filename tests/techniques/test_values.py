"""Values that kernels take as arguments are in no key: another one allocates and compiles nothing,
and gives bit-identical results as an object that is prepared for it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any, get_type_hints

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.bench.calls import FEW
from ssgi_cl.bench.drawn import with_holes
from ssgi_cl.bench.every import Inputs, inputs
from ssgi_cl.core.params import Params, parameter_fields
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.filters.upsample import UpsampleParams, coarse_size

from .analytic import slow_but

SIZE = (36, 48)
NEAR = {"max_radius_px": 6.0}
SLICES = {"radius": 0.9, "tap_power": 2.5, "bias": 0.1, "contrast": 2.0, "frame": 5, **NEAR}


@dataclass(frozen=True)
class Case:
    """A technique, parameters to begin with, and other values of some.

    Attributes:
        call: returns its results.
        params: the dataclass of the parameters.
        base: the parameters of the first call.
        changed: name -> another value of the same shape, each tried alone.
    """

    call: Callable[..., Any]
    params: type[Params]
    base: Mapping[str, Any] = field(default_factory=dict)
    changed: Mapping[str, Any] = field(default_factory=dict)


RADIUS = {"radius": 0.5}
"""Of cases that give none: by default it follows the depth."""


def on_gbuffer(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda given, **params: function(given.gbuffer, **RADIUS | params)


def on_map(function: Callable[..., Any], number: int = 0) -> Callable[..., Any]:
    return lambda given, **params: function(given.gbuffer, given.maps[number], **params)


def of_views(given: Inputs, **params: Any) -> Any:
    maps = (*given.maps, None, None)
    return gi.ssdo(given.single, given.lights, shadow_maps=maps, auxiliary_views=[given.view], **RADIUS | params)


def lit(given: Inputs, **params: Any) -> Any:
    return gi.ssdo(given.gbuffer, given.lights, **RADIUS | params)


def upsampled(given: Inputs, **params: Any) -> Any:
    rows, columns = coarse_size(given.gbuffer.size, 2)
    return gi.upsample(given.image[:rows, :columns], given.gbuffer, **params)


def accumulated(given: Inputs, **params: Any) -> Any:
    """Three frames, the first of which another G-buffer of the same camera is of."""
    images = (given.image, given.image[::-1], given.image[:, ::-1])
    seen = (given.single, given.gbuffer, given.gbuffer)
    mean, history, previous = given.image, None, None
    for image, gbuffer in zip(images, seen, strict=True):
        mean, history = gi.accumulate(image, gbuffer, previous, history, **params)
        previous = gbuffer
    assert history is not None
    return mean, history.fast, history.count, history.reasons


GRID = {"plane_tolerance": 0.05, "normal_tolerance": 0.9}
VPLS = {"cutoff": 0.2, "unit_distance": 0.5, "refine": 1.0}


def sampled(given: Inputs, power: float = 1.0, **params: Any) -> Any:
    lights = [scaled(light, power) for light in given.lights]
    return gi.sampled_lights(given.gbuffer, lights, scene=given.scene, **params)


def carried(given: Inputs, **params: Any) -> Any:
    return gi.radiosity(given.scene, given.lights, rsms=given.maps, **params).flux


def mirrored(given: Inputs, **params: Any) -> Any:
    size = np.shape(given.gbuffer.depth)[-2:]
    glossy = dataclasses.replace(given.gbuffer, specular=np.full((*size, 3), 0.5), gloss=np.full(size, 60.0))
    return gi.reflections(
        glossy,
        np.linspace(0.0, 1.0, given.image.size).reshape(given.image.shape),
        given.lights,
        scene=with_holes(given.scene),
        shadow_maps=[given.maps[0], None, None, None],
        radiosity=FEW,
        **params,
    )


CASES = {
    "ssao": Case(
        on_gbuffer(gi.ssao),
        gi.SsaoParams,
        {"outside": "open", "max_samples": 32, "near_px": 30.0, "blur_resolution": "full", "resolution": "half"},
        {
            "radius": 0.9,
            "length_power": 1.5,
            "ramp_start": 0.2,
            "ramp_end": 3.0,
            "power": 2.0,
            "bias": 0.2,
            "contrast": 1.0,
            "outside": 0.8,
            "near_px": 10.0,
            **NEAR,
        },
    ),
    "ssao, several radii": Case(on_gbuffer(gi.ssao), gi.SsaoParams, {"radius": (0.2, 0.6)}, {"radius": (0.3, 1.5)}),
    "ssao, exponential": Case(on_gbuffer(gi.ssao), gi.SsaoParams, {"falloff": "exponential"}, {"falloff_rate": 3.0}),
    "ssao, curve": Case(
        on_gbuffer(gi.ssao),
        gi.SsaoParams,
        {"falloff": (1.0, 0.5, 0.0)},
        {"falloff": (1.0, 0.9, 0.2), "falloff_end": 0.5},
    ),
    "hbao": Case(
        on_gbuffer(gi.hbao),
        gi.HbaoParams,
        {"angle_bias": 0.1, "blur_radius": 0},
        {"attenuation": 0.2, "angle_bias": 0.5, **SLICES},
    ),
    "gtao": Case(
        on_gbuffer(gi.gtao),
        gi.GtaoParams,
        {"taps": 4, "falloff": 0.6, "thin_occluder": 0.2, "horizon_decay": 0.1, "bent_normals": True, "blur_radius": 0},
        {"falloff": 0.9, "thin_occluder": 1.0, "horizon_decay": 0.2, **SLICES},
    ),
    "bitmask_ao": Case(
        on_gbuffer(gi.bitmask_ao), gi.BitmaskParams, {"blur_radius": 0}, {"thickness": 0.9, "slack": 2.0, **SLICES}
    ),
    "ssdo": Case(
        lambda given, **params: gi.ssdo(given.gbuffer, given.lights[:1], **RADIUS | params),
        gi.SsdoParams,
        {"taps": 4, "slices": 1, "thickness": 0.1, "shadow_taps": 0},
        {"radius": 0.9, "thickness": 0.8, **NEAR},
    ),
    "ssdo, auxiliary camera": Case(of_views, gi.SsdoParams, {"taps": 4, "slices": 1}, {"radius": 0.9, **NEAR}),
    "ssdo, points": Case(
        of_views,
        gi.SsdoParams,
        {"method": "points", "samples": 4, "thickness": 0.1},
        {"radius": 0.9, "thickness": 0.8, **NEAR},
    ),
    "ssdo, published": Case(
        lit,
        gi.SsdoParams,
        {"method": "published", "samples": 4},
        {"radius": 0.9, "strength": 2.0, "nearest_distance": 0.2, **NEAR},
    ),
    "rsm_gather": Case(
        on_map(gi.rsm_gather), gi.RsmGatherParams, {"samples": 50, "pattern": "rotated"}, {"radius": 0.3}
    ),
    "rsm_gather, six faces": Case(
        on_map(gi.rsm_gather, 1),
        gi.RsmGatherParams,
        {"samples": 50, "pattern": "fixed", "resolution": "adaptive"},
        {"radius": 0.2, "interpolation_error": 0.5, **GRID},
    ),
    "rsm_gather, published": Case(
        on_map(gi.rsm_gather, 1),
        gi.RsmPublishedParams,
        {"method": "published", "samples": 50},
        {"radius": 0.2, "offset": 3.0, "position_tolerance": 0.5, "normal_tolerance": 2.5},
    ),
    "sampled_lights": Case(sampled, Params, {"directions": 16, "map_size": 32}, {"power": 3.0}),
    "sky_rays": Case(
        lambda given, **params: gi.sky_rays(given.gbuffer, given.lights, scene=given.scene, **params), gi.SkyRaysParams
    ),
    "area_lights": Case(
        lambda given, **params: gi.area_lights(given.gbuffer, scene=given.scene, **params), gi.AreaLightsParams
    ),
    "radiosity": Case(carried, gi.RadiosityParams, vars(FEW)),
    "reflections": Case(mirrored, gi.ReflectionsParams, {}, {"thickness": 0.1}),
    "vpl_splat": Case(on_map(gi.vpl_splat), gi.VplSplatParams, {"vpls": 64, "cutoff": 0.01}, VPLS),
    "multires_splat": Case(
        on_map(gi.multires_splat),
        gi.MultiresSplatParams,
        {"vpls": 64, "cutoff": 0.01},
        {"interpolation_error": 0.2, "light_error": 1.0, **GRID, **VPLS},
    ),
    "multires_splat, published": Case(
        on_map(gi.multires_splat),
        gi.MultiresPublishedParams,
        {"vpls": 64, "method": "published"},
        {"depth_threshold": 0.9, "normal_threshold": 2.0},
    ),
    "bilateral_blur": Case(
        lambda given, **params: gi.bilateral_blur(given.image, given.gbuffer, **params),
        gi.BilateralParams,
        {},
        {"sigma": 1.0, "depth_sigma": 0.5, "normal_sigma": 2.0},
    ),
    "accumulate": Case(
        accumulated,
        gi.AccumulateParams,
        {"limit": 3, "fast": 1, "young": 2},
        {"limit": 2, "fast": 2, "clamp_sigma": 0.3, "plane_distance": 0.05, "normal_angle": 0.02, "young": 8},
    ),
    "upsample": Case(upsampled, UpsampleParams, {}, {"background": 3.0, "depth_sigma": 0.5, "normal_sigma": 2.0}),
    "tonemap": Case(
        lambda given, **params: gi.tonemap(given.image, **params), Params, {"exposure": 1.0}, {"exposure": 0.01}
    ),
    "shade": Case(
        lambda given, power=1.0, **params: gi.shade(
            given.gbuffer,
            [scaled(light, power) for light in given.lights],
            shadow_maps=[given.maps[0], None, None, None],
            **params,
        ),
        Params,
        {},
        {"power": 3.0},
    ),
}

MODES: dict[str, dict[str, Any]] = {
    "ssao": {"ao": "ssao"},
    "hbao": {"ao": "hbao"},
    "gtao": {},
    "bitmask_ao": {"ao": "bitmask_ao"},
    "multires": {"indirect": "multires", "vpls": 64},
    "vpl": {"indirect": "vpl", "vpls": 64, "glossy_vpls": 16},
    "gather": {"indirect": "gather", "ao": False},
    "ssdo": {"indirect": "ssdo"},
    "ssdo, auxiliary cameras": {"indirect": "ssdo", "layers": 2, "auxiliary_cameras": 2},
    "ssdo as published": {"indirect": "ssdo", "method": "published"},
}


def scaled(light: Any, factor: float) -> Any:
    """Return a light of `factor` times the power."""
    name = next(n for n in ("intensity", "irradiance", "radiance") if hasattr(light, n))
    return dataclasses.replace(light, **{name: factor * np.asarray(getattr(light, name))})


def value_names(params: type[Params]) -> set[str]:
    """Return the parameters of which not all is part of the shape."""
    kinds = get_type_hints(params)
    return {
        name
        for name, declared in parameter_fields(params).items()
        if kinds[name] is float or declared.metadata.get("shape")
    }


def bits(results: Any) -> list[str]:
    """Return a digest of the bits of one array, or of each of several."""
    arrays = results if isinstance(results, tuple) else (results,)
    return [sha256(np.ascontiguousarray(array)).hexdigest() for array in arrays]


@pytest.fixture(scope="module")
def given(runtime: Runtime) -> Inputs:
    return inputs(runtime, SIZE, 32)


def check(
    runtime: Runtime, run: Callable[[Mapping[str, Any]], list[str]], base: Mapping[str, Any], changed: Mapping[str, Any]
) -> None:
    """Check that `run` with other values takes nothing, and gives what it gives prepared anew."""
    first, found = run(base), {}
    before = runtime.builds, runtime.allocated_bytes
    for name, value in changed.items():
        found[name] = run({**base, name: value})
        assert (runtime.builds, runtime.allocated_bytes) == before, name
        assert found[name] != first, f"{name} has no effect"
    assert run(base) == first  # and back
    for name, value in changed.items():
        runtime._prepared.clear()
        assert run({**base, name: value}) == found[name], name
    assert runtime.allocated_bytes > before[1]


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.changed])
def test_values_are_arguments(runtime: Runtime, given: Inputs, name: str) -> None:
    case = CASES[name]
    check(runtime, lambda params: bits(case.call(given, runtime=runtime, **params)), case.base, case.changed)


def test_every_value_is_tried() -> None:
    kinds = {case.params for case in CASES.values()} - {Params}
    for kind in kinds:
        tried = {name for case in CASES.values() if case.params is kind for name in case.changed}
        assert tried == value_names(kind), kind


# Values of the others' techniques are those of `test_values_are_arguments`.
@pytest.mark.parametrize("name", slow_but(MODES, "ssao", "gtao", "multires", "ssdo"))
def test_values_of_a_frame_are_arguments(runtime: Runtime, given: Inputs, name: str) -> None:
    def run(params: Mapping[str, Any]) -> list[str]:
        own = dict(params)
        power = own.pop("power", 1.0)
        frame = gi.render(
            given.scene,
            given.gbuffer.camera,
            [scaled(light, power) for light in given.lights],
            bounces=0,
            shadow_size=32,
            rsm_size=32,
            runtime=runtime,
            **own,
        )
        return [
            bits(plane)[0] for plane in (frame.ao, frame.indirect, frame.image, frame.radiance) if plane is not None
        ]

    mode = {"ao_radius": 0.3, "exposure": 1.0, **MODES[name]}
    changed = {"power": 3.0, "exposure": 0.2}
    if name != "gather":  # which knows no radius
        changed["ao_radius"] = 0.8
    check(runtime, run, mode, changed)


def test_other_shapes_are_refused(runtime: Runtime) -> None:
    technique = gi.Gtao(runtime, SIZE, gi.GtaoParams(slices=1))
    technique.params = gi.GtaoParams(slices=1, radius=2.0)
    for other in (gi.GtaoParams(slices=2), gi.GtaoParams(slices=1, falloff=0.5), gi.HbaoParams(slices=1)):
        with pytest.raises(ValueError, match="Gtao was prepared for GtaoParams"):
            technique.params = other
    assert technique.params == gi.GtaoParams(slices=1, radius=2.0)
