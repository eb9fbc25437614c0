"""One picture in the conventions of many programs: each file gives the ambient occlusion of the arrays."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray

import ssgi_cl as gi
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.depth_kind import detected_kind
from ssgi_cl.core.depth_maps import ray_lengths
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.io import exr
from ssgi_cl.rasterize.scenes import make_scene

Doubles = NDArray[np.float64]
SIZE = (120, 160)
"""Rows and columns."""
RADIUS = 0.4


@dataclass(frozen=True)
class Picture:
    """A picture of a room with holes in it, and its ambient occlusion."""

    camera: Camera
    depth: Doubles
    normal: Doubles
    ao: NDArray[np.float32]


@pytest.fixture(scope="module")
def picture(runtime: Runtime) -> Picture:
    room = make_scene("parlour")
    rows, columns = SIZE
    camera = Camera.look_at(room.eye, room.target, (0.1, 1.0, 0.0), yfov=0.9, width=columns, height=rows)
    drawn = gi.rasterize.gbuffer(room.scene, camera, runtime=runtime)
    depth = np.asarray(drawn.depth, np.float64).copy()
    depth[:10, :30] = np.inf
    normal = np.where(np.isfinite(depth)[..., None], np.asarray(drawn.normal, np.float64), 0.0)
    ao = gi.gtao(GBuffer(camera=camera, depth=depth, normal=normal), radius=RADIUS, runtime=runtime)
    return Picture(camera, depth, normal, ao)


def write(path: Path, channels: dict[str, Any], **attributes: Any) -> None:
    """Write channels as they are, with attributes."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **attributes}
    planes = {name: np.ascontiguousarray(plane, np.float32) for name, plane in channels.items()}
    OpenEXR.File(header, planes).write(str(path))


def triple(names: str, vectors: Doubles) -> dict[str, Doubles]:
    """Return a channel for each of three names and components."""
    return {name: vectors[..., i] for i, name in enumerate(names.split())}


def farthest(depth: Doubles, background: float = 1e10) -> Doubles:
    return np.where(np.isfinite(depth), depth, background)


def row_vectors(matrix: Doubles) -> NDArray[np.float32]:
    """Return a matrix for column vectors as OpenEXR's attributes have it."""
    return np.ascontiguousarray(matrix.T, np.float32)


def standard(camera: Camera) -> dict[str, Any]:
    """Return worldToCamera and worldToNDC of a camera, by the definitions of OpenEXR's StandardAttributes."""
    to_clip = camera.projection @ camera.view
    x, y, _, w = to_clip
    ndc = np.stack([0.5 * (x + w), 0.5 * (w - y), to_clip[2], w])
    forward = np.diag([1.0, 1.0, -1.0, 1.0]) @ camera.view
    return {"worldToCamera": row_vectors(forward), "worldToNDC": row_vectors(ndc)}


def fov_across(camera: Camera) -> float:
    return math.degrees(2.0 * math.atan(1.0 / camera.projection[0, 0]))


def blender(path: Path, p: Picture) -> dict[str, Any]:
    z_up = p.normal @ np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    names = "ViewLayer.Normal.X ViewLayer.Normal.Y ViewLayer.Normal.Z"
    write(
        path,
        {
            "ViewLayer.Depth.Z": farthest(p.depth),
            **triple(names, z_up),
            "ViewLayer.Diffuse Color.R": 0.0 * z_up[..., 0],
        },
    )
    return {"camera": p.camera}


def old_blender(path: Path, p: Picture) -> dict[str, Any]:
    z_up = p.normal @ np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    write(
        path,
        {
            "RenderLayer.Depth.Z": farthest(p.depth),
            **triple("RenderLayer.Normal.X RenderLayer.Normal.Y RenderLayer.Normal.Z", z_up),
        },
    )
    return {"camera": p.camera, "layout": "blender"}


def arnold(path: Path, p: Picture) -> dict[str, Any]:
    write(path, {"Z": farthest(p.depth), **triple("N.X N.Y N.Z", p.normal)}, **standard(p.camera), software="Arnold 7")
    return {}


def arnold_by_focal_length(path: Path, p: Picture) -> dict[str, Any]:
    film = {"CameraFilmApertureX": 36.0, "CameraFocalLength": 18.0 * float(p.camera.projection[0, 0])}
    in_view = p.normal @ p.camera.view[:3, :3].T
    write(path, {"Z": farthest(p.depth * ray_lengths(p.camera)), **triple("N.X N.Y N.Z", in_view)}, **film)
    return {}


def v_ray(path: Path, p: Picture) -> dict[str, Any]:
    near, far = 0.5, 30.0
    in_view = p.normal @ p.camera.view[:3, :3].T
    placed = np.linalg.inv(p.camera.view)
    write(
        path,
        {
            "ZDepth": np.clip((farthest(p.depth) - near) / (far - near), 0.0, 1.0),
            **triple("Normals.R Normals.G Normals.B", in_view),
        },
        cameraTransform=row_vectors(placed),
        cameraFov=fov_across(p.camera),
    )
    return {"depth_range": (near, far), "normal_space": "camera"}


def redshift(path: Path, p: Picture) -> dict[str, Any]:
    placed = np.linalg.inv(p.camera.view)
    attributes = {"rs/camera/fov": fov_across(p.camera), "rs/camera/xform": row_vectors(placed)}
    write(path, {"Z": farthest(p.depth), **triple("N.X N.Y N.Z", p.normal)}, **attributes)
    return {}


def karma(path: Path, p: Picture) -> dict[str, Any]:
    write(
        path,
        {"ray:hitPz": farthest(p.depth), **triple("ray:hitN.x ray:hitN.y ray:hitN.z", p.normal)},
        **standard(p.camera),
    )
    return {}


def karma_distances(path: Path, p: Picture) -> dict[str, Any]:
    distance = farthest(p.depth * ray_lengths(p.camera))
    write(path, {"ray:hitdist": distance, **triple("ray:hitN.x ray:hitN.y ray:hitN.z", p.normal)}, **standard(p.camera))
    return {}


def renderman(path: Path, p: Picture) -> dict[str, Any]:
    # Its world is left-handed: z is the other way; and this writer has transposed the matrices.
    mirror = np.diag([1.0, 1.0, -1.0, 1.0])
    matrices = {name: np.ascontiguousarray((mirror @ m.astype(np.float64)).T) for name, m in standard(p.camera).items()}
    matrices = {name: m.astype(np.float32) for name, m in matrices.items()}
    normal = p.normal * [1.0, 1.0, -1.0]
    write(path, {"__depth.r": farthest(p.depth), **triple("__Nworld.r __Nworld.g __Nworld.b", normal)}, **matrices)
    return {"normal_space": None}


def unreal(path: Path, p: Picture) -> dict[str, Any]:
    # Ours to Unreal's: x forward, y right, z up; centimetres.
    theirs = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    right, _, back = p.camera.view[:3, :3] @ theirs.T
    position = 100.0 * theirs @ p.camera.position
    forward = -back
    pitch, yaw = math.asin(forward[2]), math.atan2(forward[1], forward[0])
    # Roll from the axes of an unrolled camera.
    level_right = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    level_up = np.cross(forward, level_right)
    roll = math.atan2(-float(right @ level_up), float(right @ level_right))
    attributes = {f"unreal/camera/curPos/{axis}": f"{value:.9g}" for axis, value in zip("xyz", position, strict=True)}
    angles = {"pitch": pitch, "yaw": yaw, "roll": roll}
    attributes |= {f"unreal/camera/curRot/{name}": f"{math.degrees(value):.9g}" for name, value in angles.items()}
    attributes |= {"unreal/camera/fov": f"{fov_across(p.camera):.9g}"}
    prefix = "FinalImageMovieRenderQueue_WorldNormal"
    channels = {"FinalImageMovieRenderQueue_WorldDepth.R": farthest(100.0 * p.depth, 6e6)}
    write(path, {**channels, **triple(f"{prefix}.R {prefix}.G {prefix}.B", p.normal @ theirs.T)}, **attributes)
    return {}


def nuke(path: Path, p: Picture) -> dict[str, Any]:
    write(path, {"depth.Z": 1.0 / p.depth, **triple("N.x N.y N.z", p.normal)}, **{"nuke/node_hash": "0"})
    return {"camera": p.camera}


def hydra(path: Path, p: Picture) -> dict[str, Any]:
    near, far = 0.5, 40.0
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=8, height=8, near=near, far=far)
    projection = p.camera.projection.copy()
    projection[2] = camera.projection[2]
    camera = Camera(view=p.camera.view, projection=projection, width=p.camera.width, height=p.camera.height)
    value = np.where(np.isfinite(p.depth), (far - near * far / farthest(p.depth)) / (far - near), 1.0)
    write(path, {"depth": value, **triple("Neye.x Neye.y Neye.z", p.normal)})
    return {
        "camera": camera,
        "layout": "hydra",
        "depth_kind": "normalised",
        "channels": {"normal": ("Neye.x", "Neye.y", "Neye.z")},
    }


PROGRAMS: dict[str, tuple[Callable[[Path, Picture], dict[str, Any]], float]] = {
    "blender": (blender, 1.0), "old blender": (old_blender, 1.0), "arnold": (arnold, 1.0),
    "arnold, distances": (arnold_by_focal_length, 1.0), "v-ray": (v_ray, 1.0), "redshift": (redshift, 1.0),
    "karma": (karma, 1.0), "karma, distances": (karma_distances, 1.0), "renderman": (renderman, 1.0),
    "unreal": (unreal, 100.0), "nuke": (nuke, 1.0), "hydra": (hydra, 1.0),
}  # fmt: skip
"""What writes the file and returns arguments of `from_exr`, and the scene units of its file in one of ours."""


@pytest.mark.parametrize(("program", "unit"), PROGRAMS.values(), ids=PROGRAMS)
def test_every_layout_gives_the_occlusion_of_the_arrays(
    tmp_path: Path, picture: Picture, runtime: Runtime, program: Callable[..., Any], unit: float
) -> None:
    path = tmp_path / "a.exr"
    arguments = program(path, picture)
    found = GBuffer.from_exr(path, **arguments)
    depth = found.first("depth")
    if program is unreal:  # its far plane, which it has no sign for
        depth = np.where(depth >= 6e6, np.inf, depth)
        found = GBuffer(camera=found.camera, depth=depth, normal=found.normal)
    holes = ~np.isfinite(picture.depth)
    np.testing.assert_array_equal(np.isinf(depth), holes)
    # Some roundings of float32; of values in 0..1, depth has those of the far plane.
    np.testing.assert_allclose(depth[~holes], unit * picture.depth[~holes], rtol=2e-5)
    assert found.normal is not None
    ao = gi.gtao(found, radius=unit * RADIUS, runtime=runtime)
    # A rounding may move a tap to the next pixel: few pixels, by little.
    assert math.sqrt(float(np.mean((ao - picture.ao) ** 2))) < 2e-3


@pytest.mark.parametrize("kind", ["planar", "ray", "inverse"])
def test_the_kind_of_depth_is_told_by_planes(picture: Picture, kind: str) -> None:
    stored = {
        "planar": picture.depth,
        "ray": picture.depth * ray_lengths(picture.camera),
        "inverse": 1.0 / picture.depth,
    }
    for values in (stored[kind], stored[kind].astype(np.float16)):
        found = detected_kind(values.astype(np.float32), picture.camera)
        assert (found.name, found.clear) == (kind, True)
        assert found.residual < 0.25 * found.other


def test_edges_tell_nothing(runtime: Runtime) -> None:
    box = make_scene("cornell_box")
    camera = Camera.look_at(box.eye, box.target, box.up, yfov=0.9, width=320, height=240)
    far_off = np.asarray(gi.rasterize.gbuffer(box.scene, camera, runtime=runtime).depth)
    # All but the back wall, which faces the camera and is flat for any kind, are narrower than the steps.
    assert detected_kind(far_off, camera).name == "planar"


def test_a_bent_surface_tells_nothing() -> None:
    camera = Camera.look_at((0, 0, 0), (0, 0, -1), width=64, height=64)
    y, x = np.mgrid[:64, :64] / 64.0 - 0.5
    found = detected_kind(3.0 + x * x - 2.0 * y * y + np.sin(9.0 * x * y), camera)
    assert (found.name, found.clear) == ("planar", False)


def test_what_is_said_goes_before_what_is_found(tmp_path: Path, picture: Picture) -> None:
    write(tmp_path / "a.exr", {"Z": farthest(picture.depth)})
    found = GBuffer.from_exr(tmp_path / "a.exr", camera=picture.camera, depth_kind="ray")
    np.testing.assert_allclose(found.depth, picture.depth / ray_lengths(picture.camera), rtol=1e-6)
    assert "depth is distance along the view ray, as said" in found.notes
    found = GBuffer.from_exr(tmp_path / "a.exr", camera=picture.camera)
    assert any(note.startswith("depth is planar: planes are flat to ") for note in found.notes)


@pytest.mark.parametrize(
    ("camera", "off_centre"),
    [
        (Camera.look_at((1, 2, 3), (-4, 0, 1), width=64, height=40, yfov=0.7), False),
        (Camera.look_at((1, 2, 3), (-4, 0, 1), width=64, height=40).cropped(-3, 5, 64, 40), True),
        (Camera.orthographic((1, 2, 3), (-4, 0, 1), view_height=3.0, width=64, height=40), False),
    ],
    ids=("perspective", "off centre", "orthographic"),
)
@pytest.mark.parametrize("transposed", [False, True])
def test_cameras_of_the_standard_matrices(tmp_path: Path, camera: Camera, off_centre: bool, transposed: bool) -> None:
    matrices = standard(camera)
    if transposed:
        matrices = {name: np.ascontiguousarray(matrix.T) for name, matrix in matrices.items()}
    write(tmp_path / "a.exr", {"Z": np.ones((40, 64))}, **matrices)
    found = exr.read_camera(tmp_path / "a.exr").camera
    assert found is not None
    np.testing.assert_allclose(found.view, camera.view, atol=1e-5)
    np.testing.assert_allclose(found.pixel_to_view, camera.pixel_to_view, atol=1e-5)
    assert (abs(found.projection[0, 2]) > 0.01) == off_centre


def test_a_camera_of_the_display_window_is_cropped(tmp_path: Path) -> None:
    camera = Camera.look_at((1, 2, 3), (0, 0, 0), width=64, height=40)
    windows = {
        "displayWindow": (np.array([0, 0], np.int32), np.array([63, 39], np.int32)),
        "dataWindow": (np.array([10, 4], np.int32), np.array([29, 19], np.int32)),
    }
    write(tmp_path / "a.exr", {"Z": np.ones((16, 20))}, **standard(camera), **windows)
    found = exr.read_camera(tmp_path / "a.exr").camera
    assert found is not None
    np.testing.assert_allclose(found.pixel_to_view, camera.cropped(10, 4, 20, 16).pixel_to_view, atol=1e-5)
    assert GBuffer.from_exr(tmp_path / "a.exr").camera.size == (16, 20)


def test_what_a_header_lacks_is_said(tmp_path: Path, picture: Picture) -> None:
    write(tmp_path / "a.exr", {"Z": farthest(picture.depth)}, worldToCamera=standard(picture.camera)["worldToCamera"])
    with pytest.raises(ValueError, match=r"a\.exr: camera is None, and the header has none \(camera: worldToCamera of"):
        GBuffer.from_exr(tmp_path / "a.exr")
    sheared = standard(picture.camera)
    sheared["worldToCamera"] = sheared["worldToCamera"].copy()
    sheared["worldToCamera"][0, 1] += 0.5
    write(tmp_path / "a.exr", {"Z": farthest(picture.depth)}, **sheared)
    assert exr.read_camera(tmp_path / "a.exr").camera is None


def test_layouts_are_named_and_ranges_asked_for(tmp_path: Path, picture: Picture) -> None:
    path = tmp_path / "a.exr"
    write(path, {"ZDepth": np.clip(picture.depth / 30.0, 0.0, 1.0)}, software="V-Ray Next")
    with pytest.raises(ValueError, match=r"all depths are in 0\.\.1.* expected depth_range=\(depth of 0, depth of 1\)"):
        GBuffer.from_exr(path, camera=picture.camera)
    with pytest.raises(ValueError, match=r"layout is 'vray': expected .*; did you mean 'v-ray'\?"):
        GBuffer.from_exr(path, camera=picture.camera, layout="vray")
    with pytest.raises(ValueError, match="depth_kind is 'remaped'"):
        GBuffer.from_exr(path, camera=picture.camera, depth_kind="remaped")
    with pytest.raises(ValueError, match="expected 0 < near < far < inf for normalised depth"):
        GBuffer.from_exr(path, camera=picture.camera, depth_kind="normalised")
    found = GBuffer.from_exr(path, camera=picture.camera, depth_range=(0.0, 30.0))
    assert "layout: v-ray, by 'V-Ray'" in found.notes
