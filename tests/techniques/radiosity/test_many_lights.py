"""Lights that surfels trace rays to: bounds, weights, and sums against those of all lights."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.lights import SpotLight
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.techniques.radiosity import many_lights, surfels_on_device
from ssgi_cl.techniques.radiosity import radiosity as radiosity_module
from ssgi_cl.techniques.radiosity.many_lights import traced_lights

from .test_radiosity import box, solved

Doubles = NDArray[np.float64]


def units(rng: np.random.Generator, count: int) -> Doubles:
    ways = rng.normal(size=(count, 3))
    found: Doubles = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    return found


def records(rng: np.random.Generator, count: int) -> NDArray[np.float32]:
    """Lights in a cube, along a curve as those from maps are; some far brighter than others."""
    made = np.zeros((count, 12), np.float32)
    along = np.linspace(0.0, 40.0, count)
    made[:, 0:3] = np.stack([np.sin(along), np.cos(1.3 * along), np.sin(0.7 * along)], axis=1)
    made[:, 3] = 0.01
    made[:, 4:7] = units(rng, count)
    made[:, 8:11] = rng.lognormal(0.0, 1.5, (count, 1)) * [1.0, 0.6, 0.3]
    return made


def receivers(rng: np.random.Generator, count: int) -> tuple[Doubles, Doubles]:
    """Groups of 16 neighbours that face alike."""
    groups = -(-count // 16)
    middle, facing = rng.uniform(-1, 1, (groups, 3)), units(rng, groups)
    at = np.repeat(middle, 16, axis=0) + rng.uniform(-0.05, 0.05, (16 * groups, 3))
    normal = np.repeat(facing, 16, axis=0) + rng.normal(scale=0.1, size=(16 * groups, 3))
    return at[:count], normal[:count] / np.linalg.norm(normal[:count], axis=1, keepdims=True)


def irradiance(at: Doubles, normal: Doubles, lights: NDArray[np.float32]) -> Doubles:
    """Return [n, lights] by luminance: cos cos / (pi d^2 + A), as `surfel_weight` has it."""
    way = lights[None, :, :3].astype(np.float64) - at[:, None]
    squared = (way**2).sum(axis=2)
    received = np.maximum(np.einsum("nlk,nk->nl", way, normal), 0.0)
    emitted = np.maximum(np.einsum("nlk,lk->nl", way, lights[:, 4:7].astype(np.float64)), 0.0)
    flux = lights[:, 8:11].astype(np.float64) @ many_lights.LUMINANCE
    found: Doubles = flux * received * emitted / (squared * (np.pi * squared + lights[:, 3]))
    return found


def counted(n: int, lights: int, chosen: tuple[NDArray[np.int32], NDArray[np.float32]]) -> Doubles:
    """Return [n, lights] what each light counts for each receiver."""
    table = np.zeros((n, lights + 1))
    for i in range(n):
        table[i, chosen[0][i // 16]] = chosen[1][i // 16]
    return table[:, :-1]  # the last column is number -1


def test_no_receiver_gets_more_than_the_bound_of_its_group() -> None:
    rng = np.random.default_rng(1)
    at, normal = receivers(rng, 320)
    lights = records(rng, 500)
    most = many_lights._most(at.astype(np.float32), normal.astype(np.float32), lights)
    found = irradiance(at, normal, lights).reshape(-1, 16, 500).max(axis=1)
    assert (found <= most * 1.0001 + 1e-9).all()  # float32
    # And it is no arbitrary number: half of the pairs that give nothing are known to.
    assert (most[found == 0.0] == 0.0).mean() > 0.5


def test_few_lights_are_all_taken_once() -> None:
    rng = np.random.default_rng(2)
    at, normal = receivers(rng, 40)
    numbers, weights = traced_lights(at.astype(np.float32), normal.astype(np.float32), records(rng, 64), 64)
    np.testing.assert_array_equal(numbers, np.tile(np.arange(64), (3, 1)))
    assert (weights == 1.0).all()


@pytest.mark.parametrize("count", [16, 1003])
def test_sums_are_those_of_all_lights(count: int) -> None:
    rng = np.random.default_rng(3)
    at, normal = receivers(rng, count)
    lights = records(rng, 4096)
    chosen = traced_lights(at.astype(np.float32), normal.astype(np.float32), lights, 512)
    assert chosen[0].shape[0] == -(-count // 16)
    taken = (chosen[0] >= 0).sum(axis=1)
    # Lights that may not count have no share, so that fewer than 512 may be left to take.
    assert taken.max() <= 513
    assert taken.mean() > 400
    each = irradiance(at, normal, lights)
    found = (each * counted(count, 4096, chosen)).sum(axis=1)
    whole = each.sum(axis=1)
    error = found - whole
    assert np.sqrt((error**2).mean()) < 0.05 * whole.mean()
    if count > 16:
        assert abs(error.mean()) < 0.005 * whole.mean()
    # What may give much is there, and counts once.
    filled = np.minimum(np.arange(-(-count // 16) * 16), count - 1)
    most = np.repeat(
        many_lights._most(at[filled].astype(np.float32), normal[filled].astype(np.float32), lights), 16, axis=0
    )[:count]
    strong = most > most.sum(axis=1, keepdims=True) / 512
    assert strong.any()
    np.testing.assert_allclose(counted(count, 4096, chosen)[strong], 1.0, rtol=1e-6)


def test_groups_looked_at_a_few_at_a_time_take_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(5)
    at, normal = (a.astype(np.float32) for a in receivers(rng, 200))
    lights = records(rng, 900)
    whole = traced_lights(at, normal, lights, 100)
    monkeypatch.setattr(many_lights, "MOST_PAIRS", 2000)
    for one, other in zip(whole, traced_lights(at, normal, lights, 100), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_group_that_no_light_reaches_traces_none() -> None:
    at = np.zeros((16, 3), np.float32)
    normal = np.tile(np.float32([0, 1, 0]), (16, 1))
    lights = records(np.random.default_rng(4), 200)
    lights[:, 1] = -1.0  # below
    numbers, weights = traced_lights(at, normal, lights, 50)
    assert (numbers == -1).all()
    assert (weights == 0.0).all()


def test_surfels_get_a_quarter_of_the_rays_and_the_same_light(
    runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(radiosity_module, "rays_meet_triangles", lambda scene: False)
    light = SpotLight((0, 0.0, 0.0), (0, -1, 0), 0.6, 3.0)
    found = []
    for rays in (1024, 256):
        monkeypatch.setattr(surfels_on_device, "RAYS", rays)
        made = solved(runtime, box(0.5), (light,), vpls=1024, bounces=2)
        found.append(made.irradiance[:, 1])
    every, some = found
    assert (every != some).any()
    area = made.surfels.area
    assert area @ some == pytest.approx(area @ every, rel=0.01)
    assert np.sqrt(area @ (some - every) ** 2 / area.sum()) < 0.05 * (area @ every / area.sum())
