"""Quantities are found under the names of many programs, of one layer, and what was read is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.normal_space import UnclearSpaceError
from ssgi_cl.io import exr
from ssgi_cl.io.exr_channels import AmbiguousLayerError, found_channels

DEPTHS = (
    "Z", "z", ".Z", "Z.R", "depth", "depth.R", "depth.T", "depth.V", "dd.y", "Pz", "P.Z", "hitPz", "left.depth.Z",
    "left.Z", "zDepth", "Y", "DEPTH.Z", "FinalImageMovieRenderQueue_WorldDepth.R", "ViewLayer.Denoising Depth.Z",
    "A.B.Depth.Z",
)  # fmt: skip
NORMALS = (
    "N.X", "N.R", "normal.r", "n.x", "Nx", ".normals.X", "Nsx", "Ns.X", "Nn.x", "hitN.x", "Normals.R", "worldNormal.X",
    "SHADING_NORMAL.X", "sh_normal.X", "ViewLayer.Normal.X", "ViewLayer.Denoising Normal.X",
)  # fmt: skip
TRIPLES = {"X": "XYZ", "x": "xyz", "R": "RGB", "r": "rgb"}


def triple(first: str) -> tuple[str, ...]:
    return tuple(first[:-1] + component for component in TRIPLES[first[-1]])


@pytest.mark.parametrize("name", DEPTHS)
def test_a_depth_is_found(name: str) -> None:
    assert found_channels([name]).channels == {"depth": (name,)}


@pytest.mark.parametrize("first", NORMALS)
def test_normals_are_found(first: str) -> None:
    found = found_channels(["Z", *triple(first)])
    assert found.channels == {"depth": ("Z",), "normal": triple(first)}
    assert found.notes == ("depth is read from Z", f"normal is read from {', '.join(triple(first))}")


def test_quantities_are_of_one_layer() -> None:
    names = ["BG.Depth.Z", "Main.Depth.Z", *triple("Main.Normal.X"), "R", "G", "B"]
    found = found_channels(names)
    assert found.layer == "Main"
    assert found.channels == {"depth": ("Main.Depth.Z",), "normal": triple("Main.Normal.X")}
    assert found.notes[-1] == "not read: BG.Depth.Z, R, G, B"
    assert found_channels(names, "BG").channels == {"depth": ("BG.Depth.Z",)}
    with pytest.raises(ValueError, match="layer is 'Fg': expected one with a depth, which are 'BG', 'Main'"):
        found_channels(names, "Fg")


def test_two_views_are_refused_with_their_list() -> None:
    with pytest.raises(AmbiguousLayerError, match=r"layers 'left', 'right' have a depth each: say which .* layer="):
        found_channels(["left.Z", "right.Z"])


def test_a_given_depth_decides_the_layer() -> None:
    names = ["left.Z", "right.Z", *triple("left.N.X"), *triple("right.N.X")]
    found = found_channels(names, given={"depth": ("right.Z",)})
    assert found.channels["normal"] == triple("right.N.X")


def test_vectors_and_colours_are_no_depth() -> None:
    with pytest.raises(ValueError, match="no depth channel; it has"):
        found_channels([*triple("velocity.X"), "R", "G", "B", "A"])


def test_what_is_not_read_may_be_of_any_kind(tmp_path: Path) -> None:
    # A Cryptomatte manifest of some megabytes, and chroma at half size.
    plane = np.ones((4, 6), np.float32)
    channels = {"Z": OpenEXR.Channel("Z", plane), "RY": OpenEXR.Channel("RY", plane, 2, 2)}
    OpenEXR.File({"cryptomatte/manifest": "x" * (5 << 20)}, channels).write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(exr.read_gbuffer(tmp_path / "a.exr")["depth"], plane)
    with pytest.raises(ValueError, match="channel 'RY' is subsampled 2 x 2"):
        exr.read(tmp_path / "a.exr")


def test_normals_of_the_world_and_of_the_camera_give_the_same_gbuffer(tmp_path: Path) -> None:
    camera = Camera.look_at((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), width=32, height=24)
    # A floor and a wall behind it, where each is nearer.
    sx, sy, ox, oy = camera.pixel_to_view
    x, y = sx * (np.arange(32) + 0.5) + ox, sy * (np.arange(24)[:, None] + 0.5) + oy
    rays = np.stack([*np.broadcast_arrays(x, y, -1.0)], axis=-1) @ camera.view[:3, :3]
    normals = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    with np.errstate(divide="ignore"):
        reach = (np.array([0.0, -2.0]) - normals @ camera.position) / (rays @ normals.T)
    reach[reach <= 0.0] = np.inf
    depth, world = reach.min(axis=-1).astype(np.float32), normals[reach.argmin(axis=-1)].astype(np.float32)
    for name, normal in (("world", world), ("camera", (world @ camera.view[:3, :3].T).astype(np.float32))):
        exr.write(tmp_path / "a.exr", {"depth": depth, "normal": normal})
        found = GBuffer.from_exr(tmp_path / "a.exr", camera=camera)
        np.testing.assert_allclose(found.normal, world, atol=1e-6)
        assert f"space {name!r}" in found.notes[-1]
    exr.write(tmp_path / "a.exr", {"depth": depth, "normal": np.roll(world, 9, axis=0) + np.float32(0.5)})
    with pytest.raises(UnclearSpaceError, match=r"a\.exr: normal is in no space that is clear: .* normal_space"):
        GBuffer.from_exr(tmp_path / "a.exr", camera=camera)
    assert GBuffer.from_exr(tmp_path / "a.exr", camera=camera, normal_space="world").normal is not None
