"""The order of lights in a tree, kept while they turn."""

from __future__ import annotations

import numpy as np

from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.vpl.kept_order import KeptOrder
from ssgi_cl.techniques.vpl.packed_vpls import DeviceVpls
from ssgi_cl.techniques.vpl.vpl_tree import VplTree

from ..analytic import camera

TREE_NUMBER = 11
"""Float of a record: number of the light."""
COUNT = 40


def normals(rng: np.random.Generator) -> np.ndarray:
    found = rng.normal(size=(COUNT, 3))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


class Lights:
    """Some lights, and a tree over them."""

    def __init__(self, runtime: Runtime, rng: np.random.Generator) -> None:
        self.device = DeviceVpls(runtime, 64)
        self.tree = VplTree(runtime, self.device, 0, 0)
        self.position, self.flux = rng.random((COUNT, 3)), rng.uniform(0.5, 1.0, (COUNT, 3))

    def order(self, facing: np.ndarray, order: KeptOrder | None, count: int = COUNT) -> list[int]:
        """Return the numbers of the first `count` lights in the order of a tree, if they face these ways."""
        own = slice(count)
        self.device.upload(Vpls(self.position[own], facing[own], self.flux[own], np.ones(count)), camera())
        self.tree.update(order)
        return self.tree.records()[0][:count, TREE_NUMBER].astype(int).tolist()


def test_lights_that_turn_keep_their_places(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    lights, order = Lights(variant_runtime, rng), KeptOrder()
    first, turned = normals(rng), normals(rng)
    alone = lights.order(first, None)
    assert lights.order(first, order) == alone
    assert lights.order(turned, None) != alone
    assert lights.order(turned, order) == alone
    order.forget()
    assert lights.order(turned, order) == lights.order(turned, None)


def test_lights_that_come_later_are_behind_all_others(runtime: Runtime, rng: np.random.Generator) -> None:
    lights, order = Lights(runtime, rng), KeptOrder()
    facing = normals(rng)
    before = lights.order(facing, order, COUNT - 5)
    assert lights.order(facing, order) == [*before, *range(COUNT - 5, COUNT)]
    # A tree of another size has none that was kept.
    assert sorted(Lights(runtime, rng).order(facing, order)) == list(range(COUNT))
    assert order.axes(runtime, 32)[1] == 1
    assert order.axes(runtime, 32)[1] == 2
