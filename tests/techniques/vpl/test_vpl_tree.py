"""The tree of virtual point lights: against its reference, sums, limits, order, far and near
groups."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.vpls import Vpls
from ssgi_cl.device.arrays import DeviceArray
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.vpl.vpl_splat import receivers, vpl_splat_reference
from ssgi_cl.reference.vpl.vpl_tree import VplTreeReference, group_of
from ssgi_cl.techniques.vpl.packed_vpls import DeviceVpls
from ssgi_cl.techniques.vpl.vpl_splat import VplSplatParams
from ssgi_cl.techniques.vpl.vpl_tree import GROUP, VplTree

from ..analytic import CAMERAS, camera, scene
from .given import lit_scene, uploaded

SHARE = 0.25
"""Of what is computed, which is added to what is there."""


def lights(rng: np.random.Generator, count: int = 300) -> Vpls:
    """Patches of lights of alike direction round the analytic scenes, as on surfaces."""
    patches = -(-count // 25)
    middle = rng.uniform((-1.5, -0.2, -1.5), (1.5, 1.5, 1.5), (patches, 3)).repeat(25, axis=0)
    way = rng.standard_normal((patches, 3)).repeat(25, axis=0)
    normal = way + 0.1 * rng.standard_normal(way.shape)
    return Vpls(
        (middle + 0.1 * rng.standard_normal(way.shape))[:count],
        (normal / np.linalg.norm(normal, axis=1, keepdims=True))[:count],
        rng.uniform(0.5, 1.0, (count, 3)),
        rng.uniform(1e-3, 1e-2, count),
    )


def every_pixel(runtime: Runtime, seen: NDArray[np.bool_], turn: int = 1) -> DeviceArray:
    """Every `turn`th pixel comes one after the other, from the first on, then from the second on."""
    order = np.concatenate([np.flatnonzero(seen)[start::turn] for start in range(turn)])
    row, column = np.unravel_index(order, seen.shape)
    return runtime.array(np.concatenate([[len(row)], row << 16 | column]).astype(np.int32))


Kinds = Callable[[int], list[NDArray[np.bool_]]]


class Lit:
    """Irradiance of all pixels of an image, group by group in the order of rows, or as `every_pixel` has it."""

    def __init__(
        self,
        runtime: Runtime,
        gbuffer: GBuffer,
        vpls: Vpls,
        light_error: float,
        other: float = 0.0,
        turn: int = 1,
        **values: float,
    ) -> None:
        self.seen, self.point, self.normal = receivers(gbuffer)
        device = DeviceVpls(runtime, max(len(vpls), 1), parts=vpls.parts is not None)
        device.upload(vpls, gbuffer.camera)
        self.tree = VplTree(runtime, device, 0, int("cutoff" in values))
        source, samples = uploaded(runtime, gbuffer), every_pixel(runtime, self.seen, turn)
        result, shares = runtime.plane(3, gbuffer.size), runtime.plane(1, gbuffer.size)
        shares.upload(np.full((1, *gbuffer.size), SHARE, np.float32))
        self.tree.reserve(self.seen.size)
        self.tree.update()
        beside = runtime.plane(3, gbuffer.size)
        beside.upload(np.full((3, *gbuffer.size), other, np.float32))
        self.tree.measure(source, samples, values, 0.01, light_error, [beside] if other > 0.0 else [])
        self.tree.shine(source, samples, self.seen.size, shares, result, values)
        self.irradiance = np.moveaxis(result.download(), 0, -1) / SHARE
        self.tolerance, self.outshone = self.tree.limits.download()[1:].astype(float).tolist()

    def in_view(self, gbuffer: GBuffer) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        view = gbuffer.camera.view
        return self.point @ view[:3, :3].T + view[:3, 3], self.normal @ view[:3, :3].T


def full(gbuffer: GBuffer, vpls: Vpls) -> NDArray[np.float64]:
    return vpl_splat_reference(gbuffer, vpls, VplSplatParams(cutoff=0.0))


# ---- against the reference


@pytest.mark.parametrize("count", [1, 5, 64, 300])
def test_records_are_those_of_the_reference(variant_runtime: Runtime, rng: np.random.Generator, count: int) -> None:
    gbuffer, vpls = scene("corner", camera(), rng), lights(rng, count)
    tree = Lit(variant_runtime, gbuffer, vpls, 0.01).tree
    found, wanted = tree.records()[0], VplTreeReference(vpls, gbuffer.camera)
    unit = tree.lights.unit
    power = tree.lights.values["gain"] * unit**2
    pairs: tuple[tuple[NDArray[Any], NDArray[Any]], ...] = (
        (found[:, :3] * unit, wanted.position),
        (-found[:, 4:7], wanted.normal),
        (found[:, 8:11] * power, wanted.flux),
        (found[:, 3] * unit**2, wanted.area),
    )
    for one, other in pairs:
        # Sums of at most 64 roundings of 2^-24.
        np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize("light_error", [1e-4, 3e-3, 0.1])
def test_cuts_and_their_light_are_those_of_the_reference(
    runtime: Runtime, rng: np.random.Generator, kind: str, light_error: float
) -> None:
    gbuffer, vpls = scene("bumpy", camera(kind, size=(24, 32)), rng), lights(rng)
    lit = Lit(runtime, gbuffer, vpls, light_error)
    numpy_reference = VplTreeReference(vpls, gbuffer.camera)
    point, normal = lit.in_view(gbuffer)
    found = lit.irradiance[lit.seen]
    groups = range(0, len(point), GROUP)
    cuts = lit.tree.cuts(len(groups))
    other = total = 0
    for start, records in zip(groups, cuts, strict=True):
        own = slice(start, start + GROUP)
        wanted = numpy_reference.cut(group_of(point[own], normal[own]), lit.tolerance)
        other += len(np.setxor1d(records, wanted))
        total += len(wanted)
        light = numpy_reference.irradiance(records, point[own], normal[own])
        # Grazing light is a difference of float32 positions.
        np.testing.assert_allclose(found[own], light, rtol=1e-3, atol=1e-5 * found.mean())
    # An error next to the tolerance, or a light next to a horizon, may round to either side.
    assert other < 0.01 * total


def kinds_of_runs(
    lit: Lit, gbuffer: GBuffer, found: Kinds, wanted: Callable[[Any, Any], NDArray[np.bool_]]
) -> tuple[float, float]:
    """Return in which share of records the kernels' flags and the reference's differ, and which
    share of the latter are set.

    Args:
        lit: what is lit, group by group.
        gbuffer: the image.
        found: returns the flags of the first groups' records.
        wanted: returns them of records and a group.
    """
    point, normal = lit.in_view(gbuffer)
    starts = range(0, len(point), GROUP)
    cuts, flags = lit.tree.cuts(len(starts)), found(len(starts))
    expected = [
        wanted(records, group_of(point[start : start + GROUP], normal[start : start + GROUP]))
        for start, records in zip(starts, cuts, strict=True)
    ]
    one, other = np.concatenate(flags), np.concatenate(expected)
    return float(np.mean(one != other)), float(np.mean(other))


NEXT = 0.01
"""Share of runs that may round to the other side of a tolerance."""


@pytest.mark.parametrize("kind", CAMERAS)
@pytest.mark.parametrize(("flag", "light_error"), [("shared", 6.0), ("bright", 1.0)])
def test_lights_that_share_a_shadow_ray_are_those_of_the_reference(
    runtime: Runtime, rng: np.random.Generator, kind: str, flag: str, light_error: float
) -> None:
    gbuffer, vpls = scene("bumpy", camera(kind, size=(24, 32)), rng), lights(rng)
    lit = Lit(runtime, gbuffer, vpls, light_error)
    tree = VplTreeReference(vpls, gbuffer.camera)
    expected = tree.faint if flag == "shared" else tree.bright
    off, share = kinds_of_runs(
        lit, gbuffer, getattr(lit.tree, flag), lambda records, group: expected(records, group, lit.tolerance)
    )
    assert off < NEXT
    assert 0.05 < share < 0.95


@pytest.mark.parametrize(("other", "factor"), [(2.0, 1.0), (7.0, 1.6), (50.0, 2.0)])
def test_more_lights_share_a_ray_where_other_light_outshines_them(
    runtime: Runtime, rng: np.random.Generator, other: float, factor: float
) -> None:
    gbuffer, vpls = scene("bumpy", camera(size=(24, 32)), rng), lights(rng)
    alone = Lit(runtime, gbuffer, vpls, 6.0)
    assert alone.outshone == 1.0
    # A tolerance of the same size, so that the same runs are listed.
    lit = Lit(runtime, gbuffer, vpls, 6.0 / (1.0 + other), other * alone.tolerance / 6.0)
    assert lit.outshone == pytest.approx(1.0 + other, rel=1e-3)
    assert lit.tolerance == pytest.approx(alone.tolerance, rel=1e-3)
    tree = VplTreeReference(vpls, gbuffer.camera)
    off, _ = kinds_of_runs(
        lit, gbuffer, lit.tree.shared, lambda records, group: tree.faint(records, group, factor * lit.tolerance)
    )
    assert off < NEXT


@pytest.mark.parametrize("light_error", [0.0, 3e-3])
def test_near_lights_give_way_to_their_parts_as_in_the_reference(
    variant_runtime: Runtime, rng: np.random.Generator, light_error: float
) -> None:
    gbuffer, whole = scene("bumpy", camera(size=(24, 32)), rng), lights(rng)
    each = [np.repeat(v, 16, axis=0) for v in (whole.position, whole.normal, whole.flux)]
    spread = 0.05 * rng.standard_normal(each[0].shape)
    # Parts of different flux, so that none stands for another.
    flux = each[2] * rng.uniform(0.0, 2.0 / 16.0, (len(each[2]), 1))
    parts = Vpls(each[0] + spread, each[1], flux, np.repeat(whole.area, 16) / 16.0)
    vpls, refine = replace(whole, parts=parts), 300.0
    lit = Lit(variant_runtime, gbuffer, vpls, light_error, refine=refine)
    reference = VplTreeReference(vpls, gbuffer.camera)
    point, normal = lit.in_view(gbuffer)
    found, wanted, unrefined = lit.irradiance[lit.seen], [], []
    groups = range(0, len(point), GROUP)
    for start, records in zip(groups, lit.tree.cuts(len(groups)), strict=True):
        own = slice(start, start + GROUP)
        wanted.append(reference.irradiance(records, point[own], normal[own], refine=refine))
        unrefined.append(reference.irradiance(records, point[own], normal[own]))
    # Grazing light is a difference of float32 positions.
    light = np.concatenate(wanted)
    np.testing.assert_allclose(found, light, rtol=1e-3, atol=1e-4 * found.mean())
    assert np.mean(np.abs(found - np.concatenate(unrefined)) > 0.05 * found.mean()) > 0.05


@pytest.mark.parametrize("light_error", [0.0, 0.005])
def test_every_kernel_variant_gives_the_same_result(
    runtime: Runtime, other_variant: Runtime, rng: np.random.Generator, light_error: float
) -> None:
    gbuffer, vpls = scene("bumpy", camera(size=(33, 41)), rng, margin=(3, 5)), lights(rng)
    one, other = (Lit(r, gbuffer, vpls, light_error) for r in (runtime, other_variant))
    # Contraction is off, so variants differ only where a device's division is not exact.
    np.testing.assert_allclose(one.irradiance, other.irradiance, rtol=1e-6)
    groups = -(-int(one.seen.sum()) // GROUP)
    for a, b in zip(one.tree.cuts(groups), other.tree.cuts(groups), strict=True):
        np.testing.assert_array_equal(a, b)


def with_parts(vpls: Vpls, rng: np.random.Generator, spread: float) -> Vpls:
    """Lights with 16 parts round them, in the plane of each, as surfels have them."""
    across = np.cross(vpls.normal, rng.standard_normal(vpls.normal.shape))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    along = np.cross(vpls.normal, across)
    place = rng.uniform(-spread, spread, (len(vpls), 16, 2))
    position = vpls.position[:, None] + place[..., :1] * across[:, None] + place[..., 1:] * along[:, None]
    flux = np.repeat(vpls.flux, 16, axis=0) / 16.0
    parts = Vpls(position.reshape(-1, 3), np.repeat(vpls.normal, 16, axis=0), flux, np.repeat(vpls.area, 16) / 16.0)
    return replace(vpls, parts=parts)


def test_light_does_not_depend_on_what_else_is_in_a_group(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    # Lights that are wide, so that some are behind a group whose pixels see parts of them.
    gbuffer, vpls = scene("bumpy", camera(size=(32, 32)), rng), with_parts(lights(rng), rng, 0.5)
    near, spread = (Lit(variant_runtime, gbuffer, vpls, 0.0, turn=t, refine=300.0) for t in (1, 16))
    # The same lights in the same order, less those that give nothing: sums differ by rounding alone.
    np.testing.assert_allclose(near.irradiance, spread.irradiance, rtol=1e-4, atol=1e-5 * near.irradiance.mean())
    lengths = [np.mean([len(c) for c in lit.tree.cuts(16)]) for lit in (near, spread)]
    assert lengths[0] < 0.98 * lengths[1]


# ---- against all lights


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (3, 5), (17, 31)], ids=str)
def test_without_an_error_the_light_is_that_of_all_lights(
    variant_runtime: Runtime, rng: np.random.Generator, size: tuple[int, int]
) -> None:
    gbuffer, vpls = scene("corner", camera(size=size), rng), lights(rng)
    e, wanted = Lit(variant_runtime, gbuffer, vpls, 0.0).irradiance, full(gbuffer, vpls)
    np.testing.assert_allclose(e, wanted, rtol=1e-3, atol=1e-5 * wanted.mean())


def test_several_batches_add_up(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = scene("corner", camera(size=(12, 16)), rng), lights(rng, 2600)
    wanted = full(gbuffer, vpls)
    for light_error, tolerance in ((0.0, 1e-5), (0.005, 0.01)):
        e = Lit(runtime, gbuffer, vpls, light_error).irradiance
        off = math.sqrt(np.mean((e - wanted) ** 2)) / wanted.mean()
        assert off < tolerance


@pytest.mark.parametrize("name", [pytest.param("hall", marks=pytest.mark.slow), "cornell_box"])
def test_few_lights_stand_for_many_at_a_known_error(runtime: Runtime, name: str) -> None:
    gbuffer, vpls = lit_scene(runtime, name, 160, 120)
    exact = Lit(runtime, gbuffer, vpls, 0.0)
    mean = exact.irradiance[exact.seen].mean()
    groups = -(-int(exact.seen.sum()) // GROUP)
    lengths = [np.mean([len(c) for c in exact.tree.cuts(groups)])]
    for light_error in (0.003, 0.01):
        lit = Lit(runtime, gbuffer, vpls, light_error)
        off = (lit.irradiance - exact.irradiance)[lit.seen]
        # Measured: 0.1 to 0.7 times the error that is allowed for each run, as they cancel.
        assert math.sqrt(np.mean(off**2)) < 2.0 * light_error * mean
        lengths.append(np.mean([len(c) for c in lit.tree.cuts(groups)]))
    assert lengths[0] > lengths[1] > lengths[2]


def test_the_mean_is_close_to_that_of_the_image(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = scene("corner", camera(), rng), lights(rng)
    lit = Lit(runtime, gbuffer, vpls, 0.5)
    wanted = full(gbuffer, vpls)[lit.seen].mean()
    # Runs of 16 lights whose light is not that of their mean; it is for a tolerance only.
    assert lit.tolerance == pytest.approx(0.5 * wanted, rel=0.25)


def test_other_light_adds_to_the_mean(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = scene("bumpy", camera(size=(24, 32)), rng), lights(rng)
    lit = Lit(runtime, gbuffer, vpls, 0.5)
    image = rng.uniform(0.0, 4.0, (3, 48, 64)).astype(np.float32)
    plane = runtime.plane(3, (48, 64))
    plane.upload(image)
    source, samples = uploaded(runtime, gbuffer), every_pixel(runtime, lit.seen)
    lit.tree.measure(source, samples, {}, 0.01, 0.5, [plane, plane])
    # Twice the plane's own mean, where something is: 768 or fewer of 1024 samples, each of a pixel.
    own = image.mean(axis=0)[1::2, 1::2][lit.seen].mean()
    added = float(lit.tree.limits.download()[1]) - lit.tolerance
    assert added == pytest.approx(0.5 * 2.0 * own, rel=0.01)


# ---- limits


def test_lights_on_one_spot_are_one_light(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(), rng)
    one = Vpls(np.array([[0.0, 1.0, 0.5]]), np.array([[0.0, -1.0, 0.0]]), np.array([[1.0, 2.0, 3.0]]), np.array([0.01]))
    many = Vpls(*(np.repeat(v, 64, axis=0) for v in (one.position, one.normal, one.flux, one.area)))
    lit = Lit(variant_runtime, gbuffer, many, 1e-4)
    wanted = 64.0 * full(gbuffer, one)
    np.testing.assert_allclose(lit.irradiance, wanted, rtol=1e-4, atol=1e-6 * wanted.mean())
    lengths = {len(c) for c in lit.tree.cuts(-(-int(lit.seen.sum()) // GROUP))}
    # None where it is dark; more where the light is inside the group's bounds.
    assert {1} < lengths <= {0, 1, 4, 16, 64}


def test_samples_next_to_lights_take_them_one_by_one(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("corner", camera(), rng)
    _, point, normal = receivers(gbuffer)
    # Just above the surface, and looking down at it.
    at = point[::40][:64]
    vpls = Vpls(at + 1e-3 * normal[::40][:64], -normal[::40][:64], np.ones((len(at), 3)), np.full(len(at), 1e-4))
    lit = Lit(runtime, gbuffer, vpls, 0.01)
    wanted = full(gbuffer, vpls)
    np.testing.assert_allclose(lit.irradiance, wanted, rtol=0.01, atol=0.02 * wanted.mean())


def test_a_cutoff_is_that_of_splatting(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer, vpls = scene("corner", camera(), rng), lights(rng)
    device = DeviceVpls(runtime, len(vpls))
    device.upload(vpls, gbuffer.camera)
    cut = 0.2 / math.pi * device.unit**2
    e = Lit(runtime, gbuffer, vpls, 0.0, cutoff=cut).irradiance
    wanted = vpl_splat_reference(gbuffer, vpls, VplSplatParams(cutoff=0.2))
    np.testing.assert_allclose(e, wanted, rtol=1e-3, atol=1e-4 * wanted.mean())


@pytest.mark.parametrize("power", [0.0, 1e-30, 1e30])
def test_any_flux_gives_finite_light(variant_runtime: Runtime, rng: np.random.Generator, power: float) -> None:
    gbuffer, vpls = scene("corner", camera(), rng), lights(rng, 40)
    scaled = Vpls(vpls.position, vpls.normal, vpls.flux * power, vpls.area)
    e = Lit(variant_runtime, gbuffer, scaled, 0.005).irradiance
    assert np.isfinite(e).all()
    assert (e.max() > 0.0) == (power > 0.0)


def test_no_sample_and_no_light_are_no_trouble(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    nothing = GBuffer(
        camera=camera(),
        depth=np.full(camera().size, np.inf, np.float32),
        normal=np.zeros((*camera().size, 3), np.float32),
    )
    none = Vpls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    np.testing.assert_array_equal(Lit(variant_runtime, nothing, lights(rng), 0.005).irradiance, 0.0)
    lit = Lit(variant_runtime, scene("corner", camera(), rng), none, 0.005)
    np.testing.assert_array_equal(lit.irradiance, 0.0)
