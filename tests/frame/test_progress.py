"""Progress of frames, and renderers made by the names that `render` has."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.drivers import KernelVariant
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams
from ssgi_cl.rasterize.scenes import cornell_box

BOX = cornell_box()
CAMERA = BOX.camera(32, 24)
SMALL: dict[str, Any] = {"shadow_size": 64, "rsm_size": 64}


@pytest.fixture
def fresh(runtime: Runtime) -> Runtime:
    """A runtime that has compiled nothing."""
    return Runtime(runtime.info, KernelVariant(runtime.variant.lanes, runtime.variant.storage))


@pytest.mark.parametrize("options", [{}, {"bounces": 0}, {"indirect": "multires"}, {"indirect": "ssdo"}], ids=str)
def test_the_share_grows_to_one_whatever_is_left_out(runtime: Runtime, options: dict[str, Any]) -> None:
    plain = gi.render(BOX.scene, CAMERA, BOX.lights, runtime=runtime, skips=False, **SMALL, **options)
    for skips in (False, True, True):  # the last one reuses all stages
        heard: list[float] = []
        frame = gi.render(
            BOX.scene, CAMERA, BOX.lights, runtime=runtime, skips=skips, progress=heard.append, **SMALL, **options
        )
        assert heard[0] == 0.0
        assert heard == sorted(heard)
        assert heard[-1] == 1.0
        assert heard.count(1.0) == 1
        assert len(heard) >= len(frame.graph.stages)
        np.testing.assert_array_equal(frame.image, plain.image)


def test_a_first_frame_tells_of_its_compilation_too(fresh: Runtime) -> None:
    heard: list[tuple[float, int]] = []
    gi.render(
        BOX.scene,
        CAMERA,
        BOX.lights,
        bounces=0,
        runtime=fresh,
        progress=lambda share: heard.append((share, fresh.builds)),
        **SMALL,
    )
    shares, builds = zip(*heard, strict=True)
    assert list(shares) == sorted(set(shares))
    assert shares[-1] == 1.0
    # Each program that the renderer is prepared with is told of: some ten.
    assert builds[:10] == tuple(range(10))


def test_an_exception_in_the_function_ends_the_call_and_leaves_a_sound_renderer(runtime: Runtime) -> None:
    def stop(share: float) -> None:
        if share > 0.5:
            raise KeyboardInterrupt

    given: Any = (BOX.scene, CAMERA, BOX.lights)
    expected = gi.render(*given, runtime=runtime, skips=False, **SMALL).image
    with pytest.raises(KeyboardInterrupt):
        gi.render(*given, runtime=runtime, progress=stop, **SMALL)
    np.testing.assert_array_equal(gi.render(*given, runtime=runtime, **SMALL).image, expected)


def test_a_wrong_progress_is_refused(runtime: Runtime) -> None:
    with pytest.raises(TypeError, match="progress is 'yes': expected True for a bar"):
        gi.render(BOX.scene, CAMERA, BOX.lights, runtime=runtime, progress="yes")  # type: ignore[arg-type]


def test_nothing_is_printed(runtime: Runtime, capfd: pytest.CaptureFixture[str]) -> None:
    for progress in (None, True):
        gi.render(BOX.scene, CAMERA, BOX.lights, bounces=0, runtime=runtime, progress=progress, **SMALL)
    assert capfd.readouterr() == ("", "")


def test_a_renderer_takes_the_names_of_render(runtime: Runtime) -> None:
    options: dict[str, Any] = {"bounces": 0, "ao": "ssao", "ao_samples": 8, "exposure": 2.0, **SMALL}
    by_name = gi.Renderer(runtime, CAMERA.size, **options)
    assert by_name.params == FrameParams(**options)
    both = gi.Renderer(runtime, CAMERA.size, FrameParams(ao="hbao", **SMALL), bounces=0, ao="ssao", ao_samples=8)
    assert both.params == FrameParams(bounces=0, ao="ssao", ao_samples=8, **SMALL)
    heard: list[float] = []
    frame = by_name(BOX.scene, CAMERA, BOX.lights, progress=heard.append)
    np.testing.assert_array_equal(
        frame.image, gi.render(BOX.scene, CAMERA, BOX.lights, runtime=runtime, **options).image
    )
    assert heard[-1] == 1.0
    with pytest.raises(TypeError, match=r"Renderer\(\) has no parameter 'bounce': did you mean 'bounces'\?"):
        gi.Renderer(runtime, CAMERA.size, bounce=0)  # type: ignore[call-arg]
    with pytest.raises(ValueError, match="layers is 0"):
        gi.Renderer(runtime, CAMERA.size, layers=0)
