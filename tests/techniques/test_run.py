"""Every technique's `run` has the shape that `ssgi_cl.techniques.technique` states."""

from __future__ import annotations

import inspect
import pkgutil
import re
from collections.abc import Callable
from importlib import import_module
from types import NoneType
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl import techniques
from ssgi_cl.bench.every import Inputs, inputs
from ssgi_cl.core.former_calls import former_order
from ssgi_cl.core.params import Prepared
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.catalogue import CATALOGUE
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer
from ssgi_cl.techniques.indirect.multires_grid import MultiresGrid
from ssgi_cl.techniques.indirect.packed_vpls import WorldVpls
from ssgi_cl.techniques.indirect.ssdo import SsdoPlanes
from ssgi_cl.techniques.indirect.vpl_choice import on_device_rsms
from ssgi_cl.techniques.technique import FIRST

OTHER_FIRST = {"Radiosity": "scene", "Tonemap": "radiance"}
"""Classes whose first argument isn't the G-buffer."""
NEEDED = {
    "Reflections": {"light", "lights", "shadows", "occupancy", "volume"},
    "SampledLights": {"scene"},
    "Upsample": {"reduced"},
    "UpsampleBlur": {"reduced"},
    "ViewImportance": {"occupancy"},
}
"""Arguments that are given by name and have no default."""
RESULTS = {Plane, SsdoPlanes, WorldVpls, DeviceArray, NoneType}
WITHOUT = {"SliceScan", "MultiresGrid"}
"""What is prepared without a result of its own: it prepares what others read, or is driven."""


def classes() -> dict[str, type]:
    """Return all classes of the package, by name."""
    found = {}
    for module in pkgutil.walk_packages(techniques.__path__, "ssgi_cl.techniques."):
        for name, value in vars(import_module(module.name)).items():
            if inspect.isclass(value) and value.__module__ == module.name:
                found[name] = value
    return found


CLASSES = classes()
RUNNING = {name: each for name, each in CLASSES.items() if hasattr(each, "run")}


def test_every_technique_has_a_run() -> None:
    prepared = {name for name, each in CLASSES.items() if issubclass(each, Prepared)}
    assert prepared - set(RUNNING) == WITHOUT
    assert {each.technique.__name__ for each in CATALOGUE.values()} <= prepared & set(RUNNING)
    assert len(prepared) > 20
    assert MultiresGrid in CLASSES.values()


@pytest.mark.parametrize("name", sorted(RUNNING))
def test_run_has_the_shape(name: str) -> None:
    run: Callable[..., Any] = vars(RUNNING[name]).get("run", RUNNING[name].run)
    _, *parameters = inspect.signature(run).parameters.values()
    positional = [p for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
    hints = [p for p in parameters if p.kind is p.KEYWORD_ONLY]
    assert parameters == [*positional, *hints], "anything goes"
    assert 1 <= len(positional) <= 2
    assert positional[0].name == OTHER_FIRST.get(name, "gbuffer")
    assert positional[0].name in FIRST
    assert positional[0].default is inspect.Parameter.empty
    assert {p.name for p in hints if p.default is p.empty} == NEEDED.get(name, set())
    result = get_type_hints(run)["return"]
    if name == "Tonemap":
        assert get_args(result)[1] == np.dtype[np.uint8]
    else:
        assert set(get_args(result) or (result,)) <= RESULTS


@pytest.fixture(scope="module")
def given(runtime: Runtime) -> Inputs:
    return inputs(runtime, (12, 16), 16)


def test_former_orders_of_arguments_work_and_warn(runtime: Runtime, given: Inputs) -> None:
    gbuffer, size = on_device(given.single, runtime), given.single.size
    value, coarse = runtime.plane(1, size), runtime.plane(1, (size[0] // 2, size[1] // 2))
    rng = np.random.default_rng(1)
    for plane in (value, coarse):
        plane.upload(rng.random((1, *plane.size), np.float32))
    radiance = runtime.plane(3, size)
    radiance.upload(np.moveaxis(given.image, -1, 0))
    reduced = ReducedGBuffer(gbuffer, 2)
    reduced.update(gbuffer)
    maps = on_device_rsms(given.maps[:1], runtime)
    blur, upsample = gi.Bilateral(runtime, size), gi.Upsample(runtime, size)
    splat = gi.VplSplat(runtime, size, gi.VplSplatParams(vpls=16))
    mapped = gi.Tonemap(runtime, size)
    for former, now, text in (
        (
            lambda: blur.run(value, gbuffer),
            lambda: blur.run(gbuffer, value),
            "Bilateral.run(value, gbuffer) is now run(gbuffer, value)",
        ),
        (
            lambda: blur.run(value, gbuffer, "b"),
            lambda: blur.run(gbuffer, value, name="b"),
            "run(gbuffer, value, name=name)",
        ),
        (
            lambda: upsample.run(coarse, reduced, gbuffer),
            lambda: upsample.run(gbuffer, coarse, reduced=reduced),
            "Upsample.run(coarse, reduced, gbuffer) is now run(gbuffer, coarse, reduced=reduced)",
        ),
        (
            lambda: splat.run(gbuffer, None, maps),
            lambda: splat.run(gbuffer, rsms=maps),
            "run(gbuffer, vpls, rsms=rsms)",
        ),
        (
            lambda: mapped.run(radiance, 0.5),
            lambda: mapped.run(radiance, exposure=0.5),
            "Tonemap.run(radiance, exposure) is now run(radiance, exposure=exposure)",
        ),
    ):
        with pytest.warns(DeprecationWarning, match=re.escape(text)) as found:
            first = former()
        assert found[0].filename == __file__
        bits = first.download() if isinstance(first, Plane) else first
        second = now()
        now_bits = second.download() if isinstance(second, Plane) else second
        np.testing.assert_array_equal(bits, now_bits)


def test_wrong_calls_are_refused() -> None:
    class Made:
        @former_order("value", "gbuffer", "name", first=lambda given: isinstance(given, str))
        def run(self, gbuffer: int, value: str, *, name: str = "n", step: int = 1) -> Any:
            return gbuffer, value, name, step

    made = Made()
    assert made.run(1, "v", step=2) == (1, "v", "n", 2)
    with pytest.warns(DeprecationWarning, match=r"is now run\(gbuffer, value\)"):
        assert made.run("v", gbuffer=1) == (1, "v", "n", 1)
    with pytest.raises(TypeError, match="got name by position and by name"):
        made.run("v", 1, "m", name="n")
    with pytest.raises(TypeError, match="positional"):
        made.run("v", 1, "m", 2)
    with pytest.raises(TypeError, match="missing"):
        made.run(1)
