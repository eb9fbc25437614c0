"""G-buffers and reflective shadow maps: what is taken, converted and refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.lights import Environment, PointLight, SpotLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.techniques.filters.bilateral import bilateral_blur

ROWS, COLUMNS = 5, 7
CAMERA = Camera.look_at((0, 0, 0), (0, 0, -1), width=COLUMNS, height=ROWS)
DEPTH = np.full((ROWS, COLUMNS), 2.0, np.float32)
NORMAL = np.tile(np.array([0, 0, 1], np.float32), (ROWS, COLUMNS, 1))
COLOUR = np.full((ROWS, COLUMNS, 3), 0.5, np.float32)


def test_arrays_of_the_right_kind_are_not_copied() -> None:
    gbuffer = GBuffer(camera=CAMERA, depth=DEPTH, normal=NORMAL, albedo=COLOUR)
    assert gbuffer.depth is DEPTH
    assert gbuffer.normal is NORMAL
    assert gbuffer.albedo is COLOUR
    assert (gbuffer.size, gbuffer.layers, gbuffer.margin) == ((ROWS, COLUMNS), 1, (0, 0))
    assert gbuffer.emission is None
    assert gbuffer.first("emission") is None


@pytest.mark.parametrize("dtype", [np.float16, np.float64, np.int32, np.uint8, ">f4"])
def test_other_numbers_become_float32(dtype: Any) -> None:
    gbuffer = GBuffer(camera=CAMERA, depth=DEPTH.astype(dtype), normal=NORMAL.astype(dtype))
    for array, expected in ((gbuffer.depth, DEPTH), (gbuffer.normal, NORMAL)):
        assert isinstance(array, np.ndarray)
        assert array.dtype == np.float32
        assert array.dtype.isnative
        np.testing.assert_array_equal(array, expected)


def test_lists_views_and_read_only_arrays_are_taken(rng: np.random.Generator) -> None:
    depth = rng.uniform(1, 2, (2 * ROWS, 3 * COLUMNS)).astype(np.float32)
    view = depth[::-2, ::3]
    view.flags.writeable = False
    gbuffer = GBuffer(camera=CAMERA, depth=view)
    assert np.asarray(gbuffer.depth).flags.c_contiguous
    np.testing.assert_array_equal(gbuffer.depth, view)
    planar = np.moveaxis(np.ascontiguousarray(np.moveaxis(NORMAL, -1, 0)), 0, -1)
    assert not planar.flags.c_contiguous
    np.testing.assert_array_equal(GBuffer(camera=CAMERA, depth=DEPTH.tolist(), normal=planar).normal, NORMAL)
    fixed = DEPTH.copy()
    fixed.flags.writeable = False
    assert GBuffer(camera=CAMERA, depth=fixed).depth is fixed


@pytest.mark.parametrize("margin", [(0, 0), (1, 0), (2, 3)])
def test_a_margin_is_found_from_the_size(margin: tuple[int, int]) -> None:
    shape = (ROWS + 2 * margin[0], COLUMNS + 2 * margin[1])
    depth = np.arange(1, shape[0] * shape[1] + 1, dtype=np.float32).reshape(shape)
    gbuffer = GBuffer(camera=CAMERA, depth=depth)
    assert gbuffer.margin == margin
    assert gbuffer.size == (ROWS, COLUMNS)
    inner = gbuffer.inner(depth)
    assert inner.shape == (ROWS, COLUMNS)
    assert inner[0, 0] == depth[margin]


@pytest.mark.parametrize("shape", [(6, 7), (5, 8), (3, 7), (5, 5), (4, 7), (0, 7)])
def test_a_size_that_is_no_margin_is_refused(shape: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="expected 5 x 7 as the camera, or more by an even number"):
        GBuffer(camera=CAMERA, depth=np.ones(shape))


def test_layers_come_first() -> None:
    depth = np.stack([DEPTH, DEPTH + 1, np.full_like(DEPTH, np.inf)])
    layered = np.stack([NORMAL, -NORMAL, np.zeros_like(NORMAL)])
    gbuffer = GBuffer(camera=CAMERA, depth=depth, normal=layered, albedo=COLOUR)
    assert gbuffer.layers == 3
    for name, expected in (("depth", DEPTH), ("normal", NORMAL), ("albedo", COLOUR)):
        np.testing.assert_array_equal(gbuffer.first(name), expected)
    with pytest.raises(ValueError, match=r"normal has shape \(2, 5, 7\): expected \(3, 5, 7\)"):
        GBuffer(camera=CAMERA, depth=depth, normal=layered[:2])


def test_a_layer_nearer_than_the_one_before_is_refused_with_its_pixel_and_both_depths() -> None:
    depth = np.stack([DEPTH, DEPTH, np.full_like(DEPTH, np.inf)])  # layers may touch, or be empty
    GBuffer(camera=CAMERA, depth=depth)
    depth[1, 2, 3] = np.nextafter(depth[0, 2, 3], np.float32(0.0))
    with pytest.raises(
        ValueError,
        match=rf"depth\[1, 2, 3\] is {depth[1, 2, 3]}: expected at least that of layer 0 there, "
        rf"{depth[0, 2, 3]} \(scene units\)",
    ):
        GBuffer(camera=CAMERA, depth=depth)
    depth[1, 2, 3], depth[0, 2, 3] = 2.0, np.inf  # a surface behind nothing
    with pytest.raises(ValueError, match=r"depth\[1, 2, 3\] is .* of layer 0 there, inf"):
        GBuffer(camera=CAMERA, depth=depth)


def test_normals_are_made_unit_length_but_not_where_they_are_0() -> None:
    normal = NORMAL * 3
    normal[1, 2] = 0
    normal[2, 2] = [1e-30, 0, 0]  # its square is no float32
    normal[3, 3] = [0, 3e30, 4e30]  # nor is this one's
    made = np.asarray(GBuffer(camera=CAMERA, depth=DEPTH, normal=normal).normal)
    np.testing.assert_array_equal(made[0, 0], [0, 0, 1])
    np.testing.assert_array_equal(made[1, 2], 0)
    np.testing.assert_array_equal(made[2, 2], [1, 0, 0])
    np.testing.assert_allclose(made[3, 3], [0, 0.6, 0.8], rtol=1e-7)  # one rounding to float32
    assert (normal[0, 0] == [0, 0, 3]).all()


def put(array: np.ndarray[Any, Any], value: float) -> np.ndarray[Any, Any]:
    copy = array.copy()
    copy[1, 2] = value
    return copy


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"depth": put(DEPTH, np.nan)}, r"depth\[1, 2\] is nan: .*\(scene units\), or \+inf"),
        ({"depth": put(DEPTH, -1.0)}, r"depth\[1, 2\] is -1.0"),
        ({"depth": put(DEPTH, 0.0)}, r"depth\[1, 2\] is 0.0: expected numbers > 0"),
        ({"depth": put(DEPTH, -np.inf)}, r"depth\[1, 2\] is -inf"),
        ({"depth": np.ones(7)}, r"depth has shape \(7,\)"),
        ({"depth": np.ones((0, ROWS, COLUMNS))}, r"depth has shape \(0, 5, 7\)"),
        ({"depth": np.ones((1, 1, ROWS, COLUMNS))}, "depth has shape"),
        ({"depth": np.ones((COLUMNS, ROWS))}, "depth has 7 rows and 5 columns: expected 5 x 7"),
        ({"depth": np.ones((ROWS, COLUMNS + 1))}, "depth has 5 rows and 8 columns: expected 5 x 7"),
        ({"normal": put(NORMAL, np.nan)}, r"normal\[1, 2, 0\] is nan"),
        ({"normal": put(NORMAL, np.inf)}, r"normal\[1, 2, 0\] is inf"),
        ({"normal": NORMAL[1:]}, r"normal has shape \(4, 7\): expected \(5, 7\)"),
        ({"normal": NORMAL[..., :2]}, r"normal has shape \(5, 7, 2\)"),
        ({"normal": DEPTH}, r"normal has shape \(5, 7\)"),
        ({"albedo": put(COLOUR, 1.1)}, r"albedo\[1, 2, 0\] is 1.1.*<= 1"),
        ({"albedo": put(COLOUR, -0.1)}, r"albedo\[1, 2, 0\] is -0.1"),
        ({"emission": put(COLOUR, -0.1)}, r"emission\[1, 2, 0\] is -0.1"),
        ({"emission": put(COLOUR, np.inf)}, r"emission\[1, 2, 0\] is inf"),
        ({"specular": put(COLOUR, 2.0)}, r"specular\[1, 2, 0\] is 2.0"),
        ({"gloss": put(DEPTH, -1.0)}, r"gloss\[1, 2\] is -1.0"),
        ({"gloss": DEPTH[:, 1:]}, r"gloss has shape \(5, 6\)"),
    ],
)
def test_bad_arrays_are_refused_with_the_pixel(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        GBuffer(**{"camera": CAMERA, "depth": DEPTH, **values})


@pytest.mark.parametrize("dtype", [bool, complex, object, "U1"])
def test_arrays_that_hold_no_real_numbers_and_no_camera_are_refused(dtype: Any) -> None:
    with pytest.raises(TypeError, match="depth has dtype"):
        GBuffer(camera=CAMERA, depth=np.ones((ROWS, COLUMNS)).astype(dtype))
    with pytest.raises(TypeError, match=r"camera is None: expected an ssgi_cl\.Camera"):
        GBuffer(camera=None, depth=DEPTH)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="normal has dtype"):
        GBuffer(camera=CAMERA, depth=DEPTH, normal=np.ones((ROWS, COLUMNS, 3)).astype(dtype))


def test_a_file_holds_the_front_layer(tmp_path: Path) -> None:
    gbuffer = GBuffer(camera=CAMERA, depth=np.stack([DEPTH, DEPTH + 1]), normal=NORMAL, albedo=COLOUR)
    gbuffer.to_exr(tmp_path / "a.exr")
    back = GBuffer.from_exr(tmp_path / "a.exr", camera=CAMERA)
    np.testing.assert_array_equal(back.depth, DEPTH)
    np.testing.assert_array_equal(back.normal, NORMAL)
    np.testing.assert_array_equal(back.albedo, COLOUR)
    assert back.emission is None


def shadow_map(**changes: Any) -> ReflectiveShadowMap:
    values: dict[str, Any] = {
        "light": SpotLight((0, 0, 0), (0, 0, -1), 0.5, 1.0),
        "camera": CAMERA,
        "depth": DEPTH,
        "position": NORMAL,
        "normal": NORMAL,
        "flux": COLOUR,
    }
    return ReflectiveShadowMap(**{**values, **changes})


def test_shadow_maps_are_checked_like_g_buffers() -> None:
    assert shadow_map().cameras == (CAMERA,)
    for changes, message in (
        ({"depth": put(DEPTH, 0.0)}, r"depth\[1, 2\] is 0.0"),
        ({"depth": DEPTH[1:]}, r"depth has shape \(4, 7\): expected \(5, 7\) as the light's"),
        ({"flux": put(COLOUR, -1.0)}, r"flux\[1, 2, 0\] is -1.0"),
        ({"flux": COLOUR[1:]}, r"flux has shape \(4, 7, 3\): expected \(5, 7, 3\)"),
        ({"position": put(COLOUR, np.nan)}, r"position\[1, 2, 0\] is nan"),
        ({"normal": DEPTH}, r"normal has shape \(5, 7\)"),
    ):
        with pytest.raises(ValueError, match=message):
            shadow_map(**changes)


def test_the_six_faces_of_a_point_light_are_stacked() -> None:
    arrays = {
        name: np.concatenate([array] * 6)
        for name, array in (("depth", DEPTH), ("position", NORMAL), ("normal", NORMAL), ("flux", COLOUR))
    }
    light = PointLight((0, 0, 0), 1.0)
    made = shadow_map(light=light, camera=(CAMERA,) * 6, **arrays)
    assert len(made.cameras) == 6
    with pytest.raises(ValueError, match=r"expected \(30, 7\)"):
        shadow_map(light=light, camera=(CAMERA,) * 6)


def masked(shape: tuple[int, ...]) -> Any:
    """An array of ones, the first of which is masked."""
    array = np.ma.ones(shape, np.float32)
    array[(0,) * len(shape)] = np.ma.masked
    return array


def test_masked_elements_are_refused_wherever_arrays_are_taken(runtime: Runtime) -> None:
    depth = np.ones((ROWS, COLUMNS), np.float32)
    gbuffer = GBuffer(camera=CAMERA, depth=depth)
    calls: dict[str, Callable[[], object]] = {
        "depth": lambda: GBuffer(camera=CAMERA, depth=masked((ROWS, COLUMNS))),
        "albedo": lambda: GBuffer(camera=CAMERA, depth=depth, albedo=masked((ROWS, COLUMNS, 3))),
        "normal": lambda: GBuffer(camera=CAMERA, depth=depth, normal=masked((ROWS, COLUMNS, 3))),
        "thickness": lambda: GBuffer(camera=CAMERA, depth=depth, thickness=masked((ROWS, COLUMNS))),
        "radiance": lambda: Environment(masked((2, 4, 3))),
        "position": lambda: PointLight(masked((3,)), 1.0),
        "image": lambda: bilateral_blur(masked((ROWS, COLUMNS)), gbuffer, runtime=runtime),
        "a": lambda: exr.write("nowhere/a.exr", {"a": masked((ROWS, COLUMNS))}),
        "view": lambda: Camera(view=masked((4, 4)), projection=np.eye(4), width=1, height=1),
    }
    for name, call in calls.items():
        with pytest.raises(ValueError, match=f"^{name} is a masked array with 1 masked element"):
            call()
    unmasked = np.ma.ones((ROWS, COLUMNS), np.float32)
    np.testing.assert_array_equal(GBuffer(camera=CAMERA, depth=unmasked).depth, depth)


def test_nan_is_refused_unless_it_stands_for_a_hole(tmp_path: Path) -> None:
    depth, normal, colour = np.stack([DEPTH, DEPTH + 1]), NORMAL.copy(), COLOUR.copy()
    depth[0, 1, 2] = depth[1, 3, 4] = normal[2, 2, 1] = colour[4, 5, 0] = np.nan
    before = depth.copy()
    with pytest.raises(ValueError, match=r"depth\[0, 1, 2\] is nan"):
        GBuffer(camera=CAMERA, depth=depth)
    made = GBuffer(camera=CAMERA, depth=depth, normal=normal, albedo=colour, nan="hole")
    np.testing.assert_array_equal(depth, before)  # the caller's array stays
    expected = np.stack([DEPTH, DEPTH + 1])
    expected[:, 1, 2] = expected[1, 3, 4] = np.inf
    np.testing.assert_array_equal(made.depth, expected)
    assert isinstance(made.normal, np.ndarray)
    np.testing.assert_allclose(made.normal[2, 2], NORMAL[2, 2] * [1, 0, 1])
    assert np.asarray(made.albedo)[4, 5].tolist() == [0.0, 0.5, 0.5]
    assert GBuffer(camera=CAMERA, depth=DEPTH, nan="hole").depth is DEPTH
    exr.write(tmp_path / "a.exr", {"depth": depth[0]})
    read = GBuffer.from_exr(tmp_path / "a.exr", camera=CAMERA, nan="hole")
    np.testing.assert_array_equal(read.depth, expected[0])
    with pytest.raises(ValueError, match="nan is 'zero': expected one of 'refuse', 'hole'"):
        GBuffer(camera=CAMERA, depth=DEPTH, nan="zero")  # type: ignore[arg-type]
