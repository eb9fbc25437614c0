"""A reflective shadow map in device memory, in the form that kernels read."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera
from ssgi_cl.core.lights import PunctualLight
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.device.arrays import Plane, Size
from ssgi_cl.device.constants import RSM_LEAST_COSINE
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.device.structs import CAMERA, ROTATION, Struct, camera_values, floats, ints, rotation_values

Doubles = NDArray[np.float64]

FACE = Struct("RsmFace", (*floats(*ROTATION, "x", "y", "z", "brightest"), *ints("first_row", "rows", "stamp")))

LEAST_COSINE = RSM_LEAST_COSINE
MOST_AREA = 1e30
"""Square scene units that a texel stands for at most: the sum of a map's areas is finite."""
BRIGHTEST = 1e30
"""W: a texel that reflects more counts as this, so that float32 holds all sums."""


@dataclass(frozen=True, eq=False)
class Lobes:
    """The Phong lobes of a map's texels.

    Attributes:
        axis: 3 images, world space, unit length: where the light's ray is mirrored to; 0 where
            nothing is.
        flux: 3 images, W.
        gloss: 1 image, exponent of the Phong lobe.
    """

    axis: Plane
    flux: Plane
    gloss: Plane


class DeviceRsm:
    """A reflective shadow map that stays on the device from frame to frame.

    Positions are relative to `origin` and along the world's axes, so that a map 1e6 scene units
    from the world's origin is as exact as one there.

    Args:
        runtime: the device.
        face_size: (rows, columns) of one face in texels.
        faces: 1, or 6 for a point light; of several lights, those of all of them in turn.
        glossy: whether there is room for what glossy surfaces mirror.

    Attributes:
        size: (rows, columns) of the planes: all faces, stacked from top to bottom.
        position: 3 images, scene units from `origin`; 0 where nothing is.
        normal: 3 images, world space, unit length, on the side that the light falls on; 0 where
            nothing is.
        flux: 3 images, reflected radiant flux of the texel in W.
        area: 1 image, the surface that the texel stands for in square scene units; 0 where
            nothing is.
        lobes: what texels mirror, or None if there is no room for it.
        origin: [3] float64, world space: where the light's first camera is.
        light, cameras: of the current contents (the first light); None and () before there are any.
        version: grows with every change of the contents.
        reach: how far surfaces are from `origin` along each axis, at most; scene units.
        scales: (least, greatest) distance from `origin`, or width of a texel there if that is more,
            of any surface; scene units.
        brightest: flux of a texel, at most; W.
    """

    def __init__(self, runtime: Runtime, face_size: Size, faces: int = 1, *, glossy: bool = False) -> None:
        self.runtime, self.face_size, self.faces = runtime, face_size, faces
        self.size = (face_size[0] * faces, face_size[1])
        self.position, self.normal, self.flux, self.area = (runtime.plane(n, self.size) for n in (3, 3, 3, 1))
        self.lobes = Lobes(*(runtime.plane(n, self.size) for n in (3, 3, 1))) if glossy else None
        self.origin: Doubles = np.zeros(3)
        self.light: PunctualLight | None = None
        self.cameras: tuple[Camera, ...] = ()
        self.version = 0
        self.reach = math.inf
        self.scales = (0.0, math.inf)
        self.brightest = BRIGHTEST
        # A face is lit where the device has what it was stamped with when it was written.
        self._lit = runtime.array(np.zeros(faces, np.int32))
        self._stamps = np.full(faces, -1, np.int32)
        self._uploaded: ReflectiveShadowMap | None = None
        self._kernel = runtime.kernel("rsm/rsm_face.cl", structs=(CAMERA, FACE))
        self._face_values: dict[str, Any] = {}

    def upload(self, rsm: ReflectiveShadowMap) -> None:
        """Replace the contents by a map of the same size, unless they are that very map's."""
        if rsm is self._uploaded:
            return
        self._uploaded = None
        position, normal, area = (array.astype(np.float32) for array in surfaces(rsm))
        flux = np.asarray(rsm.flux) * np.isfinite(rsm.depth)[..., None]
        flux = np.minimum(flux, np.float32(BRIGHTEST))
        mirrored = np.zeros_like(flux)
        if self.lobes is not None:
            mirrored = _specular_flux(rsm)
            self.lobes.axis.upload(np.moveaxis(mirrored_axes(rsm).astype(np.float32), -1, 0))
            self.lobes.flux.upload(np.moveaxis(mirrored, -1, 0))
            gloss = np.zeros(self.size, np.float32) if rsm.gloss is None else np.asarray(rsm.gloss)
            self.lobes.gloss.upload(gloss[None])
        brightest = max(float(flux.max()), float(mirrored.max()))
        self.begin(rsm.light, rsm.cameras, reach=float(np.abs(position).max()), brightest=brightest)
        lengths = np.maximum(np.abs(position).max(axis=-1), np.sqrt(area))[area > 0.0]
        if lengths.size:
            self.scales = float(lengths.min()), float(lengths.max())
        self.position.upload(np.moveaxis(position, -1, 0))
        self.normal.upload(np.moveaxis(normal, -1, 0))
        self.area.upload(area[None])
        self.flux.upload(np.moveaxis(flux, -1, 0))
        self._stamps[:] = self.version
        lit = (flux + mirrored).reshape(self.faces, -1).any(axis=1)
        self._lit.upload(np.where(lit, self.version, -1).astype(np.int32))
        self._uploaded = rsm

    def begin(self, light: PunctualLight, cameras: tuple[Camera, ...], *, reach: float, brightest: float) -> None:
        """Note whose map comes next; `write_face` or `upload` bring it.

        Args:
            light: the light, of several the first.
            cameras: of all faces.
            reach, brightest: as the attributes. Kernels count in them, so they may be some 10^6
                times too large.

        Raises:
            ValueError: another number or size of faces.
        """
        sizes = {camera.size for camera in cameras}
        if len(cameras) != self.faces or sizes != {self.face_size}:
            raise ValueError(
                f"the reflective shadow map has {len(cameras)} faces of {sorted(sizes)} texels: "
                f"expected {self.faces} of {self.face_size} (rows, columns)"
            )
        self.reach, self.brightest = reach, brightest
        self.scales = (reach, reach)
        self.light, self.cameras, self.origin = light, cameras, cameras[0].position
        self.version += 1
        self._uploaded = None

    def check_scale(self, technique: str, least: float, most: float) -> None:
        """Raise ValueError if all surfaces are so near or so far that float32 fails a technique.

        Args:
            technique: its name, for the message.
            least, most: scene units; not all of `scales` may be below the one or above the other.
        """
        nearest, farthest = self.scales
        if 0.0 < farthest < least or most < nearest < math.inf:
            distance = farthest if farthest < least else nearest
            raise ValueError(
                f"rsm shows surfaces {distance:.3g} from its light's camera: {technique} expects "
                f"{least:g} to {most:g} (scene units); scale the scene"
            )

    def write_face(self, face: int, depth: Plane, normal: Plane, flux: Plane) -> None:
        """Queue the pass that fills one face from planes of `face_size`; nothing is read back.

        Args:
            face: its number, in the order of `cameras`.
            depth: 1 image, scene units; INFINITY where nothing is.
            normal: 3 images, world space.
            flux: 3 images, W.
        """
        camera = self.cameras[face]
        self.version += 1
        self._stamps[face] = self.version
        values = {
            **rotation_values(camera.view[:3, :3].T),
            **dict(zip("xyz", camera.position - self.origin, strict=True)),
            "brightest": BRIGHTEST,
            "first_row": face * self.face_size[0],
            "rows": self.size[0],
            "stamp": self.version,
        }
        self._face_values = {"camera": CAMERA.pack(camera_values(camera)), "params": FACE.pack(values)}
        self._kernel.run(
            self.face_size,
            depth=depth,
            normal=normal,
            flux=flux,
            position=self.position,
            lit_normal=self.normal,
            power=self.flux,
            area=self.area,
            lit=self._lit,
            **self._face_values,
        )

    def write_lobes(self, depth: Plane, normal: Plane, flux: Plane, gloss: Plane) -> None:
        """Queue the pass that adds to the face written last what its texels mirror.

        Args:
            depth, normal: as of `write_face`.
            flux: 3 images, W.
            gloss: 1 image, exponent of the Phong lobe.
        """
        lobes = self.lobes
        if lobes is None:
            raise ValueError("the device RSM has no room for lobes: expected glossy=True")
        self.runtime.kernel("rsm/rsm_lobe.cl", structs=(CAMERA, FACE)).run(
            self.face_size,
            depth=depth,
            normal=normal,
            flux=flux,
            gloss=gloss,
            axis=lobes.axis,
            power=lobes.flux,
            sharp=lobes.gloss,
            lit=self._lit,
            **self._face_values,
        )

    def lit(self) -> NDArray[np.bool_]:
        """Return [faces] whether a face reflects anything. Waits for the device."""
        lit: NDArray[np.bool_] = self._lit.download() == self._stamps
        return lit

    def to_view(self, camera: Camera) -> Doubles:
        """Return the [3, 4] matrix from `position`'s space to a camera's view space.

        Computed in float64, so that the translation is exact however far from the world's origin
        both are; kernels get it rounded to float32. Normals take its first three columns.
        """
        turn = camera.view[:3, :3]
        return np.column_stack([turn, turn @ self.origin + camera.view[:3, 3]])

    def from_view(self, camera: Camera) -> Doubles:
        """Return the [3, 4] matrix from a camera's view space to `position`'s; see `to_view`."""
        there = self.to_view(camera)
        return np.column_stack([there[:, :3].T, -there[:, :3].T @ there[:, 3]])


def surfaces(rsm: ReflectiveShadowMap) -> tuple[Doubles, Doubles, Doubles]:
    """Return position, normal and area of every texel in float64; see `DeviceRsm`.

    Where a position is, as far as float32 can tell, what depth and camera say, these count: far
    from the world's origin they are more exact.
    """
    origin = rsm.cameras[0].position
    depth = np.asarray(rsm.depth, np.float64)
    there = np.isfinite(depth)
    seen, to_light, section = [], [], []
    for camera, face in zip(rsm.cameras, np.split(np.where(there, depth, 1.0), len(rsm.cameras)), strict=True):
        to_x, to_y, at_x, at_y = camera.pixel_to_view
        x = np.broadcast_to(to_x * (np.arange(face.shape[1]) + 0.5) + at_x, face.shape)
        y = np.broadcast_to(to_y * (np.arange(face.shape[0])[:, None] + 0.5) + at_y, face.shape)
        if camera.is_orthographic:
            k, way = np.ones(face.shape), np.broadcast_to([0.0, 0.0, 1.0], (*face.shape, 3))
        else:
            k, way = face, np.stack([-x, -y, np.ones_like(x)], axis=-1)
        length = np.linalg.norm(way, axis=-1)
        turn = camera.view[:3, :3]
        local = np.stack([x * k, y * k, -face], axis=-1)
        seen.append(local @ turn + (camera.position - origin))
        to_light.append(way / length[..., None] @ turn)
        # A beam that goes aslant is narrower by its cosine to the axis.
        section.append(abs(to_x * to_y) * k**2 / length)
    given = np.asarray(rsm.position, np.float64)
    rounding = 4.0 * np.spacing(np.abs(given).max(axis=-1, keepdims=True).astype(np.float32))
    given = given - origin
    position = np.concatenate(seen)
    position = np.where(np.abs(position - given) <= rounding, position, given)
    normal = np.asarray(rsm.normal, np.float64)
    cosine = np.sum(normal * np.concatenate(to_light), axis=-1)
    area = np.concatenate(section) / np.maximum(np.abs(cosine), LEAST_COSINE)
    normal = np.where(cosine[..., None] < 0.0, -normal, normal)
    seen_at = there[..., None]
    return position * seen_at, normal * seen_at, np.minimum(area, MOST_AREA) * there


def mirrored_axes(rsm: ReflectiveShadowMap) -> Doubles:
    """Return [rows, columns, 3] where the light's ray is mirrored to, world space, in float64."""
    position, normal, _ = surfaces(rsm)
    camera = rsm.cameras[0]
    if camera.is_orthographic:
        to_light = np.broadcast_to(camera.view[2, :3], position.shape)
    else:
        distance = np.linalg.norm(position, axis=-1, keepdims=True)
        to_light = -position / np.where(distance > 0.0, distance, 1.0)
    cosine = np.sum(normal * to_light, axis=-1, keepdims=True)
    axes: Doubles = (2.0 * cosine * normal - to_light) * np.isfinite(rsm.depth)[..., None]
    return axes


def _specular_flux(rsm: ReflectiveShadowMap) -> NDArray[np.float32]:
    if rsm.specular_flux is None:
        return np.zeros((*np.shape(rsm.depth), 3), np.float32)
    seen = np.asarray(rsm.specular_flux) * np.isfinite(rsm.depth)[..., None]
    flux: NDArray[np.float32] = np.minimum(seen, np.float32(BRIGHTEST))
    return flux


def on_device_rsm(rsm: ReflectiveShadowMap | DeviceRsm, runtime: Runtime | None = None) -> DeviceRsm:
    """Return the map in device memory, uploaded unless it is there already.

    Memory for uploads is kept by the runtime and used again for other maps of the same size.

    Raises:
        TypeError: neither a ReflectiveShadowMap nor a DeviceRsm.
        ValueError: a DeviceRsm without contents.
    """
    if isinstance(rsm, DeviceRsm):
        if rsm.light is None:
            raise ValueError("the device RSM is empty: upload or draw something first")
        return rsm
    if not isinstance(rsm, ReflectiveShadowMap):
        raise TypeError(f"rsm is {type(rsm).__name__}: expected ReflectiveShadowMap or DeviceRsm")
    runtime = runtime or Runtime.open()
    size, faces = rsm.cameras[0].size, len(rsm.cameras)
    glossy = rsm.specular_flux is not None
    device: DeviceRsm = runtime.prepared(
        (DeviceRsm, size, faces, glossy), lambda: DeviceRsm(runtime, size, faces, glossy=glossy)
    )
    device.upload(rsm)
    return device
