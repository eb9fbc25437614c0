"""`method=`: published methods by name, from the library's calls to the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

import ssgi_cl as gi
from ssgi_cl.cli.command import main
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.frame.params import FrameParams, bounce_methods
from ssgi_cl.io import exr
from ssgi_cl.rasterize.scenes import BUILTIN_SCENES
from ssgi_cl.techniques.multires import multires_splat as multires
from ssgi_cl.techniques.rsm import rsm_gather as gather

MAP = {"shadow_size": 64, "rsm_size": 64}


def rendered(runtime: Runtime, **options: Any) -> gi.Frame:
    made = BUILTIN_SCENES["cornell_box"]()
    return gi.render(
        made.scene,
        made.camera(48, 36),
        made.lights,
        bounces=0,
        runtime=runtime,
        ao=False,
        skips=False,
        outputs=("image", "indirect", "gbuffer"),
        **MAP,
        **options,
    )


@pytest.mark.parametrize("indirect", [pytest.param("multires", marks=pytest.mark.slow), "gather"])
def test_render_gives_the_light_of_the_method_asked_for(runtime: Runtime, indirect: str) -> None:
    frame = rendered(runtime, indirect=indirect, method="published")
    own = rendered(runtime, indirect=indirect)
    made = BUILTIN_SCENES["cornell_box"]()
    lights = [light for light in made.lights if not isinstance(light, gi.Environment)]
    maps = [gi.rasterize.rsm(made.scene, light, size=64, runtime=runtime) for light in lights]
    function: Any = gi.multires_splat if indirect == "multires" else gi.rsm_gather
    wanted = function(frame.gbuffer, maps, method="published", runtime=runtime)
    # Positions of the maps' texels round differently on their way through host memory.
    np.testing.assert_allclose(frame.indirect, wanted, rtol=1e-3, atol=1e-3 * float(wanted.mean()))
    assert np.abs(frame.indirect - own.indirect).mean() > 1e-3 * wanted.mean()


def bounce(name: str, method: str | None = None) -> Any:
    """Return the parameters of a technique of one bounce in frames."""
    return FrameParams(indirect=name, method=method).techniques(0.5)[1]


def test_a_method_of_ssdo_comes_from_its_own_parameters() -> None:
    choices = bounce_methods("ssdo")
    assert set(choices) >= {"bitmask", "points"}
    for method in choices:
        assert isinstance(bounce("ssdo", method), gi.SsdoParams)
        assert bounce("ssdo", method).method == method
        assert bounce("ssdo", method).radius == 0.5
    assert bounce("ssdo") == bounce("ssdo", choices[0])


def test_the_default_method_is_the_first() -> None:
    for name, methods in (("multires", multires.METHODS), ("gather", gather.METHODS)):
        assert bounce_methods(name) == tuple(methods)
        for method, kind in methods.items():
            assert type(bounce(name, method)) is kind.params
        assert type(bounce(name)) is next(iter(methods.values())).params


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"indirect": "multires", "method": "points"}, r"method is 'points': expected one of 'adaptive', 'published'"),
        ({"indirect": True, "method": 3}, r"method is 3: expected one of 'adaptive', 'published'"),
        ({"indirect": "gather", "method": "flux"}, r"method is 'flux': expected one of 'unbiased', 'published'"),
        ({"indirect": "ssdo", "method": "slices"}, r"method is 'slices': expected one of 'bitmask', 'points'"),
        (
            {"indirect": "vpl", "method": "published"},
            r"method is 'published': expected None with indirect='vpl', which has no methods",
        ),
        ({"method": "published"}, r"method is 'published': expected None with indirect=None, which has no methods"),
    ],
    ids=str,
)
def test_a_method_that_the_technique_has_not_is_refused(
    runtime: Runtime, options: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        rendered(runtime, **options)


def ssgi(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_ssgi_render_has_the_method(tmp_path: Path) -> None:
    size = ("--width", 48, "--height", 36, "--shadow-size", 64, "--rsm-size", 64)
    method = ("--indirect", "gather", "--method", "published")
    result = ssgi("render", "cornell_box", *size, *method, "-o", tmp_path / "a.png", "--json")
    assert result.exit_code == 0, result.output
    assert "rsm_published_interpolate" in {p["name"] for p in json.loads(result.stdout)["passes"]}
    failed = ssgi("render", "cornell_box", *size, "--indirect", "gather", "--method", "paper", "-o", tmp_path / "b.png")
    assert failed.exit_code == 1
    assert "method is 'paper': expected one of 'unbiased', 'published'" in failed.stderr


def test_ssgi_apply_has_the_method(tmp_path: Path, rng: np.random.Generator) -> None:
    depth = np.kron(rng.uniform(2.0, 2.4, (3, 4)), np.ones((8, 8))).astype(np.float32)
    exr.write(tmp_path / "in.exr", {"depth": depth})
    for options in (["--method", "points"], ["--set", "method=points"]):
        output = tmp_path / f"{options[0]}.exr"
        done = ssgi("apply", "ssdo", tmp_path / "in.exr", *options, "--set", "samples=4", "-o", output)
        assert done.exit_code == 0, done.output
    one, other = (exr.read(tmp_path / f"{name}.exr") for name in ("--method", "--set"))
    for channel, values in one.items():
        np.testing.assert_array_equal(values, other[channel])
    failed = ssgi("apply", "gtao", tmp_path / "in.exr", "--method", "published", "-o", tmp_path / "b.exr")
    assert failed.exit_code == 2
    assert "gtao has no parameter 'method'" in failed.stderr
