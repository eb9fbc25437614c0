"""Scenes in Mitsuba: the same surfaces as the rasteriser's, and a back end that runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import DirectionalLight, Environment, Light
from ssgi_cl.core.scene import Material, Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.view import gbuffer
from ssgi_cl.truth import mitsuba_scene
from ssgi_cl.truth.mitsuba_scene import MitsubaScene
from ssgi_cl.truth.path_tracer import BounceWithoutVisibility, DirectLight, PathTracer, Surface

pytest.importorskip("mitsuba", reason="mitsuba is not installed (extra 'truth')")


class Albedo(PathTracer):
    """What the estimators take for the reflectance of what is seen."""

    def estimate(self, seen: Surface, numbers: Sequence[Any]) -> Any:
        return seen.albedo


class Normal(PathTracer):
    """The normal, moved to [0, 1]."""

    def estimate(self, seen: Surface, numbers: Sequence[Any]) -> Any:
        return 0.5 * (self.mi.Color3f(seen.axis) + 1.0)


SUN = DirectionalLight((0.0, -1.0, 0.0), 2.0)


@pytest.fixture(params=["best", pytest.param("scalar", marks=pytest.mark.slow)])
def variant(request: pytest.FixtureRequest) -> str:
    return mitsuba_scene.best_variant() if request.param == "best" else "scalar_rgb"


def traced(
    kind: type[PathTracer], scene: Scene, camera: Camera, variant: str, lights: Sequence[Light] = (SUN,)
) -> NDArray[np.float32]:
    with mitsuba_scene.within(variant):
        return kind(scene, lights, variant).image(camera, 1, 0)


def panel(
    *,
    material: Material = Material(),  # noqa: B008  it can't be changed
    texture: NDArray[np.uint8] | None = None,
    colors: ArrayLike = (1.0, 1.0, 1.0),
    normals: ArrayLike = (0.0, 0.0, 0.0),
    height: float = 0.0,
    half: float = 1.0,
) -> dict[str, Any]:
    """Return the fields of a horizontal square about the y axis, its texture repeated twice."""
    corners = half * np.array([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], np.float32)
    return {
        "positions": corners + np.float32([0, height, 0]),
        "normals": np.broadcast_to(np.float32(normals), (4, 3)).copy(),
        "uvs": np.array([[-0.3, 0.2], [1.7, 0.2], [1.7, 2.2], [-0.3, 2.2]], np.float32),
        "colors": np.broadcast_to(np.float32(colors), (4, 3)).copy(),
        "triangles": np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        "material_ids": np.zeros(2, np.int32),
        "materials": (material,),
        "textures": () if texture is None else (texture,),
    }


def above(size: int = 64) -> Camera:
    """Return a camera that sees the square from above, nearly all of it."""
    return Camera.orthographic((0, 2, 0), (0, 0, 0), (0, 0, -1), view_height=1.9, width=size, height=size)


@pytest.mark.parametrize(
    ("textured", "colored"),
    [
        (True, "uniform"),
        (True, "varying"),
        (False, "varying"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in ((False, "uniform"), (False, "white"), (True, "white"))
        ),
    ],
)
def test_albedo_is_that_of_the_rasteriser_pixel_by_pixel(
    textured: bool, colored: str, variant: str, runtime: Runtime, rng: np.random.Generator
) -> None:
    texture = rng.integers(0, 256, (5, 7, 4), np.uint8) if textured else None
    colors = {
        "white": np.ones(3), "uniform": np.array([0.3, 0.6, 0.9]), "varying": rng.random((4, 3)),
    }[colored]  # fmt: skip
    material = Material(albedo=(0.9, 0.5, 0.7), texture=0 if textured else -1)
    scene = Scene(**panel(material=material, texture=texture, colors=colors))
    expected = gbuffer(scene, above(), runtime=runtime).first("albedo")
    assert expected is not None
    # The rasteriser interpolates between bytes in float32, on a texel of 7 pixels.
    np.testing.assert_allclose(traced(Albedo, scene, above(), variant), expected, atol=2e-4)
    assert np.ptp(expected, axis=(0, 1)).max() > (0.2 if textured or colored == "varying" else -1)


def test_vertex_colours_beyond_1_reflect_no_more_than_1(variant: str, runtime: Runtime) -> None:
    colors = np.array([1.4, 0.0, 0.5])
    scene = Scene(**panel(material=Material(albedo=(0.9, 0.9, 0.9)), colors=colors))
    expected = gbuffer(scene, above(), runtime=runtime).first("albedo")
    assert expected is not None
    np.testing.assert_allclose(expected[4, 4], (1.0, 0.0, 0.45), atol=1e-6)
    np.testing.assert_allclose(traced(Albedo, scene, above(), variant), expected, atol=2e-4)


def test_both_sides_reflect(variant: str) -> None:
    scene = Scene(**panel(material=Material(albedo=(0.2, 0.4, 0.6))))
    below = Camera.orthographic((0, -2, 0), (0, 0, 0), (0, 0, 1), view_height=1.9, width=8, height=8)
    for camera in (above(8), below):
        albedo = traced(Albedo, scene, camera, variant)
        expected = np.broadcast_to([0.2, 0.4, 0.6], albedo.shape)
        np.testing.assert_allclose(albedo, expected, rtol=1e-6)


def test_the_meshs_own_normals_are_kept_and_face_the_viewer(variant: str) -> None:
    tilted = np.array([0.6, 0.8, 0.0])
    for normal, expected in ((tilted, tilted), (-tilted, tilted), (np.zeros(3), [0.0, 1.0, 0.0])):
        seen = 2.0 * traced(Normal, Scene(**panel(normals=normal)), above(8), variant) - 1.0
        np.testing.assert_allclose(seen, np.broadcast_to(expected, seen.shape), atol=1e-6)


def test_a_vertex_without_a_normal_leaves_no_gap(variant: str) -> None:
    fields = panel(normals=(0.0, 1.0, 0.0))
    fields["normals"][2] = 0.0
    seen = 2.0 * traced(Normal, Scene(**fields), above(8), variant) - 1.0
    np.testing.assert_allclose(seen, np.broadcast_to([0.0, 1.0, 0.0], seen.shape), atol=1e-6)


def test_holes_let_sight_and_light_through(variant: str, runtime: Runtime, rng: np.random.Generator) -> None:
    texture = rng.integers(0, 256, (6, 6, 4), np.uint8)
    grate = panel(
        material=Material(albedo=(1.0, 1.0, 1.0), texture=0, alpha_cutoff=0.4, alpha=0.9), texture=texture, height=0.5
    )
    floor = panel(material=Material(albedo=(0.1, 0.2, 0.3)), half=1.5)
    both = {name: np.concatenate([grate[name], floor[name]]) for name in
            ("positions", "normals", "uvs", "colors")}  # fmt: skip
    scene = Scene(
        **both,
        triangles=np.concatenate([grate["triangles"], floor["triangles"] + 4]),
        material_ids=np.array([0, 0, 1, 1]),
        materials=(*grate["materials"], *floor["materials"]),
        textures=(texture,),
    )
    camera = above(64)
    seen = gbuffer(scene, camera, runtime=runtime)
    hole = np.asarray(seen.depth) > 1.75
    assert 0.2 < hole.mean() < 0.8
    rim = hole & False
    for axis in (0, 1):
        for step in (-1, 1):
            rim |= hole != np.roll(hole, step, axis)
    sure = ~rim[1:-1, 1:-1]  # elsewhere roundings decide
    albedo = traced(Albedo, scene, camera, variant)[1:-1, 1:-1]
    floors = np.isclose(albedo, [0.1, 0.2, 0.3], atol=1e-6).all(axis=-1)
    assert (floors == hole[1:-1, 1:-1])[sure].all()
    # Straight light meets the floor where the view ray does, nowhere else below the grate.
    light = traced(DirectLight, scene, camera, variant)[1:-1, 1:-1]
    assert (light[sure] > 1.99).all()
    aslant = DirectionalLight((0.2, -1.0, 0.1), 2.0)
    slanting = traced(DirectLight, scene, camera, variant, [aslant])[1:-1, 1:-1, 0]
    share = (slanting[floors] > 0.0).mean()
    # Seen and lit through holes that are not the same: about the share of holes.
    assert 0.5 * hole.mean() < share < 1.0
    # Light comes up from the floor's lit spots to the underside of the grate alone, which nobody
    # sees from above; and from its underside to the floor none.
    assert (traced(BounceWithoutVisibility, scene, camera, variant) == 0.0).all()


def test_environments_keep_their_orientation(variant: str, rng: np.random.Generator) -> None:
    image = rng.random((4, 8, 3))
    world = MitsubaScene.of(Scene(**panel()), [Environment(image)], variant)
    # Middles of texels: row 0 looks up +y, the middle column down -z, columns run to +x.
    polar = (np.arange(4) + 0.5) / 4 * np.pi
    azimuth = ((np.arange(8) + 0.5) / 8 - 0.5) * 2.0 * np.pi
    polar, azimuth = (a.ravel() for a in np.meshgrid(polar, azimuth, indexing="ij"))
    way = np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)])
    with mitsuba_scene.within(variant) as mi:
        import drjit

        sky = world.scene.environment()
        found = []
        for x, y, z in (-way.T).tolist():
            si = drjit.zeros(mi.SurfaceInteraction3f)
            si.wi = mi.Vector3f(x, y, z)
            found.append(np.array(sky.eval(si)).ravel())
    np.testing.assert_allclose(found, image.reshape(-1, 3), atol=1e-6)


def test_the_variant_of_before_is_set_again() -> None:
    with mitsuba_scene.within("scalar_rgb") as mi:
        other = mitsuba_scene.best_variant()
        with mitsuba_scene.within(other):
            assert mi.variant() == other
        assert mi.variant() == "scalar_rgb"
        with pytest.raises(RuntimeError, match="inside"), mitsuba_scene.within(other):
            raise RuntimeError("inside")
        assert mi.variant() == "scalar_rgb"


def test_newest_libllvm_is_chosen_and_old_ones_never(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(mitsuba_scene, "_FOLDERS", (str(tmp_path),))
    assert mitsuba_scene.libllvm() is None
    for name in ("libLLVM-14.0.6.so.1", "libLLVM-15.so.1", "libLLVM-16.so", "libLLVM.so"):
        (tmp_path / name).touch()
    assert mitsuba_scene.libllvm() is None
    for name in ("libLLVM-17.so.1", "libLLVM.so.19.1", "libLLVM-18.so"):
        (tmp_path / name).touch()
    assert mitsuba_scene.libllvm() == str(tmp_path / "libLLVM.so.19.1")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/somewhere/else.so")
    assert mitsuba_scene.libllvm() == "/somewhere/else.so"


def test_without_libllvm_the_scalar_variant_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mitsuba_scene, "libllvm", lambda: None)
    mitsuba_scene.best_variant.cache_clear()
    try:
        assert mitsuba_scene.best_variant() == "scalar_rgb"
    finally:
        mitsuba_scene.best_variant.cache_clear()
