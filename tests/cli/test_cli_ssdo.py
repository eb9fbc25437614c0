"""The command line's directional occlusion: the library's own, and messages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import DirectionalLight, Environment
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.techniques.ssdo.ssdo import ssdo

from .commands import fails, succeeds

SETTINGS = ("--set", "radius=0.3", "--set", "method=points", "--set", "samples=4")
OPTIONS = {"radius": 0.3, "method": "points", "samples": 4}


@pytest.fixture
def source(tmp_path: Path, rng: np.random.Generator) -> Path:
    """A file with depth, albedo and a picture."""
    rows = np.linspace(1.0, 2.0, 24)[:, None]
    depth = (rows + 0.2 * (np.arange(32) % 8 < 4)).astype(np.float32)
    path = tmp_path / "in.exr"
    image, albedo = rng.random((2, 24, 32, 3), np.float32)
    exr.write(path, {"depth": depth, "albedo": albedo, "image": image})
    return path


def applied(source: Path, *arguments: object) -> dict[str, NDArray[np.float32]]:
    """Return the images [rows, columns, 3] that the command writes."""
    output = source.with_name("out.exr")
    succeeds("apply", "ssdo", source, "-o", output, *SETTINGS, *arguments)
    channels = exr.read(output)
    return {name: np.stack([channels[f"{name}.{c}"] for c in "RGB"], axis=-1) for name in ("direct", "bounce")}


def gbuffer_of(source: Path) -> GBuffer:
    arrays = exr.read_gbuffer(source)
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), yfov=np.radians(50), width=32, height=24)
    return GBuffer(camera=camera, **arrays)


def test_apply_gives_what_the_library_gives(source: Path, runtime: Runtime) -> None:
    images = applied(source, "--sky", 0.5, 1, 2, "--sun", 0.1, -1, -0.2, 3)
    lights = [Environment((0.5, 1, 2)), DirectionalLight((0.1, -1, -0.2), 3)]
    direct, bounce = ssdo(gbuffer_of(source), lights, runtime=runtime, **OPTIONS)
    np.testing.assert_array_equal(images["direct"], direct)
    np.testing.assert_array_equal(images["bounce"], bounce)
    assert bounce.any()


def test_without_light_there_is_an_even_sky(source: Path, runtime: Runtime) -> None:
    images = applied(source)
    direct, _ = ssdo(gbuffer_of(source), [Environment(1.0)], runtime=runtime, **OPTIONS)
    np.testing.assert_array_equal(images["direct"], direct)


def test_a_lit_picture_is_what_surfaces_send(source: Path, runtime: Runtime) -> None:
    images = applied(source, "--lit")
    present = exr.read(source)
    image = np.stack([present[c] for c in "RGB"], axis=-1)
    _, bounce = ssdo(gbuffer_of(source), [], radiance=image, runtime=runtime, **OPTIONS)
    np.testing.assert_array_equal(images["bounce"], bounce)
    assert not images["direct"].any()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("ssao", "--sky", 1, 1, 1), "--sky is for ssdo: ssao knows no light"),
        (("gtao", "--lit"), "--lit is for ssdo: gtao knows no light"),
        (("ssdo", "--preset", "high"), "--preset is not for ssdo"),
        (("ssdo", "--budget-ms", 3), "--budget-ms is not for ssdo"),
        (("ssdo", "--sun", 0, 0, 0, 1), "direction is"),
        (("ssdo", "--sky", -1, 0, 0), "radiance is"),
        (("ssdo", "--set", "bounces=2"), "ssdo has no parameter 'bounces'"),
    ],
)
def test_wrong_options_are_named(source: Path, arguments: tuple[object, ...], words: str) -> None:
    name, *rest = arguments
    assert words in fails(source.parent, "apply", name, source, "-o", source.with_name("out.exr"), *rest)


def test_a_file_without_a_picture_is_refused(source: Path) -> None:
    exr.write(source, {"depth": np.ones((4, 6), np.float32)})
    message = fails(source.parent, "apply", "ssdo", source, "-o", source.with_name("out.exr"), "--lit")
    assert "has no channel R, which --lit needs; it has Z" in message


def test_a_knob_of_another_method_is_refused(source: Path) -> None:
    output = source.with_name("other.exr")
    message = fails(source.parent, "apply", "ssdo", source, "-o", output, *SETTINGS, "--set", "strength=2")
    assert "strength=2 applies only to method='published' (got method='points')" in message
