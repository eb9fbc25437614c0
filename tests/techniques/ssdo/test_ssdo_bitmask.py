"""Visibility bitmask of SSDO: numpy reference, furnaces, invariances, and closed surfaces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.gbuffer import SurfaceView
from ssgi_cl.reference.ssdo.ssdo_bitmask import sides_of, ssdo_bitmask_reference
from ssgi_cl.techniques.ao.occlusion import RESOLUTIONS
from ssgi_cl.techniques.direct.sky import Sky, filtered
from ssgi_cl.techniques.filters.upsample import ReducedGBuffer
from ssgi_cl.techniques.ssdo.ssdo_bitmask import SsdoBitmask, SsdoBitmaskParams, paired_layers

from ..analytic import camera, scene
from ..walls import wall_and_floor
from .cases import masks_of, planar, radiance_of, uploaded

Floats = NDArray[np.float32]

ROUNDING = 1e-5
"""Error of A, and of irradiance relative to that of a sky of the brightest radiance: the arithmetic of
bitmask AO in float32."""
IMAGE = Environment(np.random.default_rng(3).random((8, 16, 3)))
FLIPS = 3e-3
"""Share of pixels in which a tap, an end of its piece or a texel of the sky may fall to the other
side of an edge: 3 of 1209."""


def with_layers(rng: np.random.Generator, kind: str = "perspective", margin: tuple[int, int] = (2, 3)) -> GBuffer:
    """Return a bumpy scene with a deeper layer behind half of its pixels."""
    front = scene("bumpy", made := camera(kind, size=(31, 39)), rng, margin=margin)
    depth = np.asarray(front.depth)
    deeper = depth + rng.uniform(0.05, 0.5, depth.shape)
    deeper[rng.random(depth.shape) < 0.5] = np.inf
    return GBuffer(camera=made, depth=np.stack([depth, deeper]).astype(np.float32), normal=front.normal)


def gathered(
    runtime: Runtime,
    gbuffer: GBuffer,
    radiance: Floats,
    environments: tuple[Environment, ...] = (IMAGE,),
    *,
    radius: float = 0.6,
    **params: Any,
) -> tuple[Floats, SsdoBitmask]:
    """Return the results of the back end, and the back end."""
    chosen = SsdoBitmaskParams(radius=radius, **params)
    device, sent = uploaded(runtime, gbuffer), planar(runtime, radiance)
    sky = Sky(runtime)
    sky.set(environments)
    end = SsdoBitmask(runtime, gbuffer.size, chosen, gbuffer.margin, gbuffer.layers, masks=True)
    source: Any = device
    step = RESOLUTIONS[chosen.resolution]
    with runtime.frame():
        if step > 1:
            source = ReducedGBuffer(device, step)
            source.update(device)
        result = end.run(device, source, radiance=sent, sky=sky).download()
    return result, end


CHOICES: list[dict[str, Any]] = [
    {"back": 0.7},
    {"resolution": "half", "thickness": 0.1, "end": "layer", "slices": 1, "taps": 5, "cones": 3, "bent_normals": True},
]


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
@pytest.mark.parametrize("choice", CHOICES, ids=str)
def test_every_kernel_variant_agrees_with_numpy_reference(
    variant_runtime: Runtime, rng: np.random.Generator, kind: str, choice: dict[str, Any]
) -> None:
    gbuffer = with_layers(rng, kind)
    radiance = radiance_of(gbuffer, rng)
    if "back" not in choice:  # backs with radiance of their own, thickness and sides by pixel
        radiance = np.concatenate([radiance, 0.5 * radiance_of(gbuffer, rng)])
        thickness = rng.uniform(0.0, 0.2, np.shape(gbuffer.depth)[1:])
        front = np.asarray(gbuffer.normal)
        turned = np.where(rng.random(thickness.shape) < 0.7, -1.0, 1.0)[..., None]
        normal = np.stack([front, front * turned]).astype(np.float32)
        gbuffer = replace(gbuffer, thickness=thickness.astype(np.float32), normal=normal)
    found, end = gathered(variant_runtime, gbuffer, radiance, **choice)
    look_up = filtered(np.asarray(IMAGE.radiance)).astype(np.float32).astype(np.float64)
    wanted = ssdo_bitmask_reference(gbuffer, SsdoBitmaskParams(radius=0.6, **choice), radiance, look_up)
    assert found.shape == wanted.shape
    off = ~(np.abs(found - wanted) <= ROUNDING * np.pi)
    # Which neighbour gives a pixel its slope may change by rounding, and with it what those around
    # find: depths moved by 1e-7 change 2 to 22 of 1209 pixels of the orthographic reference itself.
    most = FLIPS if kind == "perspective" else 1e-2
    sky_first = 4 if "bent_normals" in choice else 1
    looked_up = off[sky_first : sky_first + 3]
    rest = np.concatenate([off[:sky_first], off[sky_first + 3 :]])
    assert rest.any(axis=0).mean() <= most
    # Each of up to 16 directions may lie on the edge of two texels of the sky's map.
    assert looked_up.any(axis=0).mean() <= 5 * FLIPS
    if end.params.slices == 1:
        assert end.masks is not None
        mask, _ = masks_of(variant_runtime, end.masks, 2, end.size)
        np.testing.assert_allclose(np.bitwise_count(mask), 32.0 * (1.0 - found[0]), atol=1e-4)


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_bounce_in_a_furnace_is_pi_l_of_what_is_hidden(runtime: Runtime, rng: np.random.Generator, kind: str) -> None:
    gbuffer = with_layers(rng, kind)
    radiance = np.sign(radiance_of(gbuffer, rng)) * np.float32(2.5)
    found, _ = gathered(runtime, gbuffer, radiance, back=1.0)
    # Sums of 2 slices of at most 32 sectors.
    np.testing.assert_allclose(found[4], np.pi * 2.5 * (1.0 - found[0]), rtol=1e-5, atol=2e-6)


def test_backs_send_nothing_and_no_more_than_is_hidden(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = with_layers(rng)
    radiance = np.sign(radiance_of(gbuffer, rng))
    dark, half, full = (gathered(runtime, gbuffer, radiance, back=back)[0][4:] for back in (0.0, 0.5, 1.0))
    np.testing.assert_allclose(half, 0.5 * (dark + full), rtol=1e-5, atol=2e-6)
    assert float(np.mean(full[0] - dark[0])) > 0.005


def test_floor_by_a_lit_wall_receives_what_the_wall_covers(runtime: Runtime) -> None:
    gbuffer, distance = wall_and_floor("perspective")
    floor = np.isfinite(distance)
    # The wall alone shines: all that the floor's pixels see within the radius is wall.
    point = gbuffer.camera.unproject(np.asarray(gbuffer.depth, np.float32))
    wall = np.abs(point[..., 0]) < np.abs(point[..., 1])
    radiance = np.where(wall[None, ..., None], 3.0, 0.0) * np.ones(3)
    found, _ = gathered(runtime, gbuffer, radiance.astype(np.float32), (), radius=1.0)
    there = floor & (distance > 0.05) & (distance < 0.9)
    hidden = np.pi * 3.0 * (1.0 - found[0])
    # Between the last tap on the floor and the first on the wall the mean of both is taken: half
    # of what lies between is lost where that is wall.
    error = found[1][there] - hidden[there]
    assert np.all(error <= 1e-5)
    assert float(error.mean()) > -0.06 * float(hidden[there].mean())


@pytest.mark.slow
def test_bounce_is_what_it_converges_to_on_average(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = scene("bumpy", camera(size=(32, 40)), rng)
    radiance = radiance_of(gbuffer, rng)
    params = {"radius": 0.6, "slices": 8, "taps": 24}
    found, _ = gathered(runtime, gbuffer, radiance, (), **params)
    # With as many sectors, quick angles and roots: 1e-4 to 6e-4 of the mean. With 1024 the dither's
    # noise too, of either sign from scene to scene: 1280 pixels with 16 sides each, whose ends are
    # rounded to 1/32, and most light falls on few of them.
    for sectors, share in ((32, 1e-3), (1024, 8e-3)):
        wanted = ssdo_bitmask_reference(gbuffer, SsdoBitmaskParams(**params), radiance, sectors=sectors)
        wanted[0], images = 1.0 - wanted[0], np.stack([1.0 - found[0], *found[1:]])
        for image, mean in zip(images, wanted.mean(axis=(1, 2)), strict=True):
            assert float(np.mean(image)) == pytest.approx(float(mean), rel=share)


def test_result_does_not_depend_on_the_unit_of_length(runtime: Runtime, rng: np.random.Generator) -> None:
    images = []
    for scale in (1.0, 1024.0):
        gbuffer = scene("bumpy", camera(scale=scale), np.random.default_rng(5), scale=scale)
        radiance = radiance_of(gbuffer, np.random.default_rng(6))
        images.append(gathered(runtime, gbuffer, radiance, (), radius=0.6 * scale)[0])
    off = np.abs(images[0] - images[1]).max(axis=0) > ROUNDING * np.pi
    assert off.mean() <= FLIPS


def test_radiance_of_any_size_gives_finite_light_in_proportion(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = with_layers(rng)
    exponent = rng.uniform(-6.0, 6.0, (1, *np.shape(gbuffer.depth)[1:], 1))
    radiance = (radiance_of(gbuffer, rng) * 10.0**exponent).astype(np.float32)
    found, _ = gathered(runtime, gbuffer, radiance)
    assert np.isfinite(found).all()
    assert found.min() >= 0.0
    brighter, _ = gathered(runtime, gbuffer, radiance * np.float32(2.0**60))
    np.testing.assert_array_equal(brighter[4:], found[4:] * np.float32(2.0**60))


def test_sky_of_one_radiance_is_pi_l_a_however_small_the_radius(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = with_layers(rng)
    there = np.isfinite(gbuffer.inner(gbuffer.first("depth")))
    sky, radiance = Environment(np.full((8, 16, 3), 2.0)), radiance_of(gbuffer, rng)
    for radius in (0.6, 1e-6):
        found, _ = gathered(runtime, gbuffer, radiance, (sky,), radius=radius)
        # The filter's texels are weighted by approximate solid angles: within 0.3 %.
        np.testing.assert_allclose(found[1][there], 2.0 * np.pi * found[0][there], rtol=3e-3, atol=1e-6)
        assert np.all(found[1][~there] == 0.0)


def test_other_shapes_are_refused(runtime: Runtime, rng: np.random.Generator) -> None:
    gbuffer = with_layers(rng)
    device = uploaded(runtime, gbuffer)
    end = SsdoBitmask(runtime, gbuffer.size, None, gbuffer.margin, 2)
    with pytest.raises(ValueError, match=r"radiance has 3 images of .*: expected 6 or 12 of"):
        end.run(device, device, radiance=runtime.plane(3, device.whole))
    end = SsdoBitmask(runtime, gbuffer.size, None, gbuffer.margin, 1)
    with pytest.raises(ValueError, match=r"size, margin and layers"):
        end.run(device, device)
    with pytest.raises(ValueError, match=r"back is 1\.5: expected"):
        replace(SsdoBitmaskParams(), back=1.5)


# ---- closed surfaces

STACKS = {
    "fbfb": (1, -1, 1, -1),  # two closed things
    "ffbb": (1, 1, -1, -1),  # one within another
    "ffb ": (0, 1, -1, 0),  # a sheet before a closed thing
    "fbf ": (1, -1, 0, 0),  # a wall behind one
    "ffff": (0, 0, 0, 0),
    "bfb ": (0, 0, 0, 0),  # a sheet from behind comes first: undecided
    "f0b ": (0, 0, 0, 0),  # a layer without a normal
    "    ": (0, 0, 0, 0),
}
"""Layers from the front: (f)ront, (b)ack, 0 without a normal, blank without a surface; and their sides."""


@pytest.mark.parametrize("kind", ["perspective", "orthographic"])
def test_layers_that_bound_something_closed_are_paired(variant_runtime: Runtime, kind: str) -> None:
    made = camera(kind, size=(1, len(STACKS)))
    towards = made.view[2, :3]  # the normal of what faces the camera
    letters = np.array([list(stack) for stack in STACKS]).T[:, None]
    signs = np.select([letters == "f", letters == "b"], [1.0, -1.0], 0.0)
    depth = np.where(letters == " ", np.inf, 2.0 + np.arange(4.0)[:, None, None])
    gbuffer = GBuffer(
        camera=made, depth=depth.astype(np.float32), normal=(signs[..., None] * towards).astype(np.float32)
    )
    plane = paired_layers(uploaded(variant_runtime, gbuffer))
    assert plane is not None
    wanted = np.array(list(STACKS.values())).T[:, None]
    np.testing.assert_array_equal(plane.download(), wanted)
    np.testing.assert_array_equal(sides_of(gbuffer, SurfaceView.of(gbuffer)), wanted)


def test_one_layer_with_normals_says_nothing(runtime: Runtime) -> None:
    for layers in (1, 2):
        assert paired_layers(DeviceGBuffer(runtime, (1, 4), layers=layers)) is None
