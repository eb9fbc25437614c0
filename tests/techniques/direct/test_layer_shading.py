"""The light that every layer sends: against deferred shading of each layer alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.gbuffer import on_device
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.reference.direct.shade import shade_reference
from ssgi_cl.techniques.direct.layer_shading import LitLayers, SenderRecords

from ..analytic import camera, check_second_run, scene

SKY = np.random.default_rng(3).random((8, 16, 3))
LIGHTS: tuple[Light, ...] = (
    PointLight((0.3, 1.5, 1.2), (1, 2, 3)),
    Environment(SKY),
    DirectionalLight((-0.3, -1.0, -0.5), (3, 2, 1)),
)
SIZE = (21, 37)


def layered(rng: np.random.Generator, margin: Size = (0, 0), *, emits: bool = True) -> GBuffer:
    """Return a G-buffer of two layers, with all attributes of both; the second has holes."""
    front, back = (scene(name, camera(size=SIZE), rng, margin=margin) for name in ("bumpy", "ball"))
    depth = np.stack([np.asarray(front.depth), 8.0 * np.asarray(back.depth)])
    shape = (*depth.shape, 3)
    return GBuffer(
        camera=front.camera,
        depth=depth,
        normal=np.stack([np.asarray(each.normal) for each in (front, back)]),
        albedo=rng.random(shape, np.float32),
        emission=rng.random(shape, np.float32) if emits else None,
    )


def alone(gbuffer: GBuffer, layer: int) -> GBuffer:
    """Return one layer, the margin as part of the image."""
    camera = gbuffer.camera.with_margin(gbuffer.margin)
    parts = {
        name: None if (array := getattr(gbuffer, name)) is None else np.asarray(array)[layer]
        for name in ("depth", "normal", "albedo", "emission")
    }
    return GBuffer(camera=camera, **parts)


def lit(
    runtime: Runtime,
    gbuffer: GBuffer,
    lights: tuple[Light, ...],
    visibility: NDArray[np.float32] | None = None,
    step: int = 1,
) -> NDArray[np.float32] | None:
    """Return radiance [layers, rows, columns, 3] with margin, or None."""
    device = on_device(gbuffer, runtime)
    plane = None
    if visibility is not None:
        plane = runtime.plane(1, visibility.shape, 1.0)
        plane.upload(visibility[None])
    with runtime.frame():
        result = LitLayers(runtime, device.whole, device.attributes).run(device, lights, visibility=plane, step=step)
        if result is None:
            return None
        return np.moveaxis(result.download().reshape(-1, 3, *device.whole), 1, -1)


def spread(visibility: NDArray[np.float32], margin: Size, step: int) -> NDArray[np.float32]:
    """Return A of the nearest pixel that has one for each pixel, margin included."""
    index = []
    for axis in (0, 1):
        at = np.arange(-margin[axis], SIZE[axis] + margin[axis])
        nearest = (np.clip(at, 0, None) + step // 2) // step
        index.append(np.minimum(nearest, visibility.shape[axis] - 1))
    return visibility[np.ix_(*index)]


def assert_layers_are_shaded(
    radiance: NDArray[np.float32], gbuffer: GBuffer, ao: NDArray[np.float32] | None = None
) -> None:
    for layer in range(2):
        single = alone(gbuffer, layer)
        there = np.isfinite(np.asarray(single.depth))
        expected = np.where(there[..., None], shade_reference(single, LIGHTS, ao=ao), 0.0)
        # float32 positions and normals: a few roundings, relative to the brightest
        np.testing.assert_allclose(radiance[layer], expected, atol=1e-5 * expected.max())


@pytest.mark.parametrize(("margin", "emits"), [((0, 0), True), ((3, 5), False)], ids=str)
def test_each_layer_is_shaded_as_if_it_were_alone(
    variant_runtime: Runtime, rng: np.random.Generator, margin: Size, emits: bool
) -> None:
    gbuffer = layered(rng, margin, emits=emits)
    radiance = lit(variant_runtime, gbuffer, LIGHTS)
    assert radiance is not None
    assert_layers_are_shaded(radiance, gbuffer)
    assert np.isinf(np.asarray(gbuffer.depth)[1]).any()


@pytest.mark.parametrize("step", [1, 2, 4])
def test_visibility_dims_the_sky_of_the_nearest_pixels(
    variant_runtime: Runtime, rng: np.random.Generator, step: int
) -> None:
    margin = (3, 5)
    gbuffer = layered(rng, margin, emits=False)
    visibility = rng.random((-(-SIZE[0] // step), -(-SIZE[1] // step)), np.float32)
    radiance = lit(variant_runtime, gbuffer, LIGHTS, visibility, step)
    assert radiance is not None
    assert_layers_are_shaded(radiance, gbuffer, spread(visibility, margin, step))


SUN, TURNED = (
    (DirectionalLight(way, (3, 2, 1)), Environment((1, 2, 3))) for way in ((-0.3, -1.0, -0.5), (0.3, 1.0, 0.5))
)
MIRRORED = np.roll(SKY[::-1], SKY.shape[1] // 2, axis=1)
"""What a sky sends to a normal it sends to the opposite one when it is mirrored at its middle: rows
from the top are those from the bottom, and columns lie half a turn further on."""


@pytest.mark.parametrize(
    ("lights", "others"), [(SUN, TURNED), ((Environment(SKY),), (Environment(MIRRORED),))], ids=["sun", "sky"]
)
def test_backs_get_the_light_that_fronts_would_get_from_the_other_side(
    variant_runtime: Runtime, rng: np.random.Generator, lights: tuple[Light, ...], others: tuple[Light, ...]
) -> None:
    device = on_device(layered(rng, (3, 5), emits=False), variant_runtime)

    def shaded(technique: LitLayers, lights: tuple[Light, ...]) -> NDArray[np.float32]:
        with variant_runtime.frame():
            radiance = technique.run(device, lights)
            assert radiance is not None
            return radiance.download()

    found = shaded(LitLayers(variant_runtime, device.whole, 2, backs=True), lights)
    fronts = LitLayers(variant_runtime, device.whole, 2)
    for half, given in ((found[:6], lights), (found[6:], others)):
        expected = shaded(fronts, given)
        np.testing.assert_allclose(half, expected, atol=(1e-6 if lights is SUN else 1e-5) * expected.max())
        assert expected[3:].any()
    assert np.abs(found[6:] - found[:6]).max() > 0.05 * found.max()


def test_records_have_radiance_to_the_bit_and_normals(variant_runtime: Runtime, rng: np.random.Generator) -> None:
    device = on_device(layered(rng, (3, 5)), variant_runtime)
    technique = LitLayers(variant_runtime, device.whole, 2)
    with variant_runtime.frame():
        radiance = technique.run(device, LIGHTS)
        records = technique.records(device, LIGHTS)
        assert radiance is not None
        assert records is not None
        packed = SenderRecords(variant_runtime, device.whole, 2)
        packed.pack(device, radiance)
        expected = np.moveaxis(radiance.download().reshape(2, 3, *device.whole), 1, -1)
        normal = np.moveaxis(device.normal.download().reshape(2, 3, *device.whole), 1, -1)
    there = np.isfinite(device.depth.download())
    rows, columns = device.whole
    for found in (records, packed):
        quads = found.array.download().reshape(2, rows, -1, 4)[:, :, :columns][there]
        np.testing.assert_array_equal(quads[:, :3].view(np.float32), expected[there])
        u, v = quads[:, 3] >> 16, (quads[:, 3] << 16) >> 16
        unfolded = np.stack([u, v, 32767 - np.abs(u) - np.abs(v)], -1).astype(np.float64)
        under = np.maximum(-unfolded[:, 2:], 0.0)
        unfolded[:, :2] -= np.copysign(under, unfolded[:, :2])
        unfolded /= np.linalg.norm(unfolded, axis=-1, keepdims=True)
        # Half a step of 1 / 32767 in two coordinates, both in the third; a face is .58 away.
        np.testing.assert_allclose(unfolded, normal[there], atol=6e-5)


def test_without_light_and_emission_nothing_is_sent(runtime: Runtime, rng: np.random.Generator) -> None:
    assert lit(runtime, layered(rng, emits=False), (PointLight((0, 1, 0), 0.0),)) is None
    assert ("lit layers", "no light and no emission") in [(each.name, each.skipped) for each in runtime.times()]
    assert lit(runtime, layered(rng), ()) is not None


def test_a_second_frame_allocates_nothing(runtime: Runtime, rng: np.random.Generator) -> None:
    device = on_device(layered(rng), runtime)
    technique = LitLayers(runtime, device.whole, 2)

    def run() -> NDArray[np.float32]:
        with runtime.frame():
            radiance = technique.run(device, LIGHTS)
            assert radiance is not None
            return radiance.download()

    check_second_run(runtime, run)


def test_other_gbuffers_are_refused(runtime: Runtime, rng: np.random.Generator) -> None:
    device = on_device(layered(rng), runtime)
    with pytest.raises(ValueError, match=r"layers with attributes are .*, 2, 2\): expected"):
        LitLayers(runtime, device.whole, 1).run(device, LIGHTS)
