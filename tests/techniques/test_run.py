"""Every technique's `run` has the shape that `ssgi_cl.techniques.technique` states."""

from __future__ import annotations

import inspect
import pkgutil
from collections.abc import Callable
from importlib import import_module
from types import NoneType
from typing import Any, get_args, get_type_hints

import numpy as np
import pytest

from ssgi_cl import techniques
from ssgi_cl.core.params import Prepared
from ssgi_cl.device.arrays import DeviceArray, Plane
from ssgi_cl.device.history import DeviceHistory
from ssgi_cl.techniques.catalogue import CATALOGUE
from ssgi_cl.techniques.multires.multires_grid import MultiresGrid
from ssgi_cl.techniques.radiosity.radiosity import RadiosityLight
from ssgi_cl.techniques.ssdo.ssdo import SsdoPlanes
from ssgi_cl.techniques.technique import FIRST

OTHER_FIRST = {"Radiosity": "scene", "Tonemap": "radiance"}
"""Classes whose first argument isn't the G-buffer."""
NEEDED = {
    "Reflections": {"light", "lights", "shadows", "volume"},
    "SampledLights": {"scene"},
    "SkyRays": {"scene"},
    "AreaLights": {"scene"},
    "SmoothEdges": {"scene", "camera"},
    "Upsample": {"reduced"},
    "UpsampleBlur": {"reduced"},
    "ViewImportance": {"occupancy"},
}
"""Arguments that are given by name and have no default."""
RESULTS = {Plane, SsdoPlanes, RadiosityLight, DeviceHistory, DeviceArray, NoneType}
WITHOUT = {"SliceScan", "MultiresGrid"}
"""Prepared classes without a result of their own: they prepare inputs of others, or are driven."""


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
        assert get_args(result)[1] == np.dtype[np.uint8 | np.uint16]
    else:
        assert set(get_args(result) or (result,)) <= RESULTS
