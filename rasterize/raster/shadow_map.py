"""The reflective shadow map of a light (Dachsbacher and Stamminger 2005)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera, look_at_matrix, orthographic_matrix, perspective_matrix
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PunctualLight, SpotLight, light_tuple
from ssgi_cl.core.reflective_shadow_map import ReflectiveShadowMap
from ssgi_cl.core.scene import Scene, box_corners
from ssgi_cl.device.arrays import Plane
from ssgi_cl.device.gbuffer import VIEW_ROTATION, DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.device.structs import CAMERA, Struct, floats, rotation_values
from ssgi_cl.rasterize.raster.device_scene import DeviceScene
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene

Vector = NDArray[np.float64]

_FLUX = ("red", "green", "blue", "axis_x", "axis_y", "axis_z", "least_cosine")
FLUX = Struct("FluxParams", floats(*_FLUX))

NEAR_SHARE = 1e-4
"""Near plane of a light's camera, as a share of the scene's extent seen from the light."""


class RsmRenderer:
    """Draws what a light sees, and its reflected flux, at one size per face.

    Args:
        runtime: the device.
        size: texels along the side of a face.
        step: flux is that of every step-th texel along rows and columns; see `every_nth`.
        flux: whether it is ever asked for.
        matt: whether flux has in it what lobes mirror.

    Attributes:
        target: the device G-buffer of what has flux; `normal_world` has what the depth shows where
            the mesh has no normals.
        flux: 3 images, W.
        specular_flux, gloss: 3 images, W, and 1 image, exponent of the Phong lobe: what the face
            drawn last mirrors, after `render_lobes`.
    """

    target: DeviceGBuffer
    flux: Plane
    specular_flux: Plane
    gloss: Plane

    def __init__(self, runtime: Runtime, size: int, *, step: int = 1, flux: bool = True, matt: bool = False) -> None:
        self.runtime = runtime
        self.step = step
        self._rasterizer = Rasterizer(runtime, (size, size), shaded=False, matt=matt)
        if flux:
            self.target = DeviceGBuffer(runtime, (-(-size // step),) * 2)
            self.flux = runtime.plane(3, self.target.size)
        self._kernel = runtime.kernel("raster/raster_flux.cl", structs=(CAMERA, FLUX))
        self._normals = runtime.kernel("rsm/rsm_normals.cl", structs=(VIEW_ROTATION,))
        self._specular: Plane | None = None

    def render(self, scene: DeviceScene, light: PunctualLight, camera: Camera, *, flux: bool = True) -> Plane | None:
        """Queue the passes for one face; return the plane of flux, if that is asked for."""
        self._rasterizer.render(scene, camera)
        if not flux:
            return None
        self.target.set_camera(every_nth(camera, self.step))
        self.target.take_world()
        self._rasterizer.write_every(self.step, scene, self.target)
        self._write_flux(light, self.target.albedo, self.flux)
        if not scene.has_normals:
            self.target.derive()
            turn = VIEW_ROTATION.pack(rotation_values(camera.view[:3, :3].T))
            self._normals.run(self.target.size, seen=self.target.normal, normal=self.target.normal_world, rotation=turn)
        return self.flux

    def write_depth(self, depth: Plane, image: int = 0) -> None:
        """Queue the pass that writes the depth of the face drawn last, see `Rasterizer`."""
        self._rasterizer.write_depth(depth, image)

    def render_lobes(self, scene: DeviceScene, light: PunctualLight) -> None:
        """Queue the passes that fill `specular_flux` and `gloss` for the face drawn last."""
        if self._specular is None:
            planes = [self.runtime.plane(n, self.target.size) for n in (3, 3, 1)]
            self._specular, self.specular_flux, self.gloss = planes
        self._rasterizer.write_gloss(self.step, scene, self._specular, self.gloss)
        self._write_flux(light, self._specular, self.specular_flux)

    def release(self) -> None:
        """Give memory that the next face is drawn to anew to others."""
        self._rasterizer.release()

    def _write_flux(self, light: PunctualLight, reflectance: Plane, flux: Plane) -> None:
        camera = self.target.camera
        assert camera is not None  # noqa: S101  a face was drawn
        self._kernel.run(
            self.target.size,
            depth=self.target.depth,
            albedo=reflectance,
            flux=flux,
            camera=self.target.camera_struct,
            params=FLUX.pack(_flux_values(light, camera)),
        )


def light_cameras(light: PunctualLight, bounds: Vector, size: int) -> tuple[Camera, ...]:
    """Return the cameras that see all that a light can reach: one, or six for a point light.

    Args:
        light: the light.
        bounds: [2, 3] box round the scene, world space.
        size: rows and columns of each camera.
    """
    corners = box_corners(bounds)
    if isinstance(light, DirectionalLight):
        return (_directional_camera(np.asarray(light.direction), corners, size),)
    position = np.asarray(light.position)
    reach = float(np.linalg.norm(corners - position, axis=1).max())
    near = NEAR_SHARE * reach
    if isinstance(light, SpotLight):
        direction = np.asarray(light.direction)
        # A texel more on every side, so that filters find neighbours at the cone's edge.
        half = math.tan(light.cone_angle) * (1.0 + 4.0 / size)
        return (_cube_camera(position, direction, _across(direction), 1.0 / half, near, size),)
    axes = np.eye(3)
    faces = [(sign * axes[i], axes[(i + 1) % 3]) for i in range(3) for sign in (1.0, -1.0)]
    return tuple(_cube_camera(position, way, up, 1.0, near, size) for way, up in faces)


def every_nth(camera: Camera, step: int) -> Camera:
    """Return the camera of an image that has the middle one of each `step` x `step` pixels, or the
    one below and to the right of the middle, each for all of them."""
    if step == 1:
        return camera
    rows, columns = (-(-side // step) for side in camera.size)
    projection = camera.projection.copy()
    for axis, (few, many) in enumerate(((columns, camera.width), (rows, camera.height))):
        share = many / (step * few)
        # By how much the pixel's centre is beyond the middle of what it stands for.
        beyond = 0.0 if step % 2 else 0.5
        shift = share - 1.0 - 2.0 * beyond / (step * few)
        projection[axis] = share * projection[axis]
        projection[axis] += (1 - 2 * axis) * shift * projection[3]
    return Camera(view=camera.view, projection=projection, width=columns, height=rows)


@serialised
def rsm(scene: Scene, light: PunctualLight, *, size: int = 512, runtime: Runtime | None = None) -> ReflectiveShadowMap:
    """Draw the reflective shadow map of a light.

    Args:
        scene: what `load_scene` returns, or one of your own making.
        light: a spot, point or directional light. A point light gets six faces, stacked from top
            to bottom: +x, -x, +y, -y, +z, -z.
        size: rows and columns of each face in texels, 1 to 8192.
        runtime: the device; by default the fastest found.

    Returns:
        Depth, position, normal and reflected flux in W of every texel: intensity times the
        texel's solid angle times albedo (directional: irradiance times the texel's area times
        albedo). It does not depend on the distance; beyond a spot's cone it is 0. If a material
        of the scene has specular reflectance, likewise the flux that it mirrors, and its gloss.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
    """
    size = checks.integer("size", size, low=1, high=8192, unit="texels")
    if not isinstance(light, PunctualLight):
        raise TypeError(f"light is {type(light).__name__}: expected a SpotLight, PointLight or DirectionalLight")
    runtime = runtime or Runtime.open()
    kept = device_scene(scene, runtime)
    renderer: RsmRenderer = runtime.prepared((RsmRenderer, size, True), lambda: RsmRenderer(runtime, size))
    cameras = light_cameras(light, scene.bounds, size)
    faces: list[list[NDArray[np.float32]]] = []
    with runtime.frame():
        for camera in cameras:
            renderer.render(kept, light, camera)
            depth = renderer.target.depth.download()[0]
            normal = np.moveaxis(renderer.target.normal_world.download(), 0, -1)
            seen = np.isfinite(depth)
            points = camera.unproject(np.where(seen, depth, np.float32(1.0)))
            position = np.where(seen[..., None], points, 0.0).astype(np.float32)
            face = [depth, position, normal, np.moveaxis(renderer.flux.download(), 0, -1)]
            if kept.glossy:
                renderer.render_lobes(kept, light)
                mirrored = np.moveaxis(renderer.specular_flux.download(), 0, -1)
                face += [mirrored, renderer.gloss.download()[0]]
            faces.append(face)
    arrays = [np.concatenate(parts) for parts in zip(*faces, strict=True)]
    for array in arrays:
        array.flags.writeable = False  # the map takes them over without a copy
    names = ("depth", "position", "normal", "flux", "specular_flux", "gloss")
    of_light = cameras if len(cameras) > 1 else cameras[0]
    return ReflectiveShadowMap(light=light, camera=of_light, **dict(zip(names, arrays, strict=False)))


@checked_keywords
def shadow_maps(
    scene: Scene, lights: Sequence[Light], *, size: int = 1024, runtime: Runtime | None = None
) -> tuple[ReflectiveShadowMap | None, ...]:
    """Draw the shadow maps of lights, as `shade`, `ssdo` and `reflections` take them.

    Williams 1978, "Casting Curved Shadows on Curved Surfaces". Departs: each is a reflective
    shadow map, see `rasterize.rsm`, so that indirect light can be made of it too.

    Args:
        scene: what casts shadows.
        lights: any number of lights.
        size: rows and columns of each face in texels, 1 to 8192.
        runtime: the device; by default the fastest found.

    Returns:
        For each light its map; None for environments, which have none.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range.
    """
    return tuple(
        None if isinstance(light, Environment) else rsm(scene, light, size=size, runtime=runtime)
        for light in light_tuple(lights)
    )


def _flux_values(light: PunctualLight, camera: Camera) -> dict[str, float]:
    power = light.irradiance if isinstance(light, DirectionalLight) else light.intensity
    axis, least = np.array([0.0, 0.0, -1.0]), -2.0
    if isinstance(light, SpotLight):
        axis = camera.view[:3, :3] @ np.asarray(light.direction)
        least = math.cos(light.cone_angle)
    return dict(zip(_FLUX, (*np.asarray(power), *axis, least), strict=True))


def _across(direction: Vector) -> Vector:
    """Return a direction that is well away from parallel."""
    axis: Vector = np.eye(3)[int(np.argmin(np.abs(direction)))]
    return axis


def _cube_camera(position: Vector, direction: Vector, up: Vector, scale: float, near: float, size: int) -> Camera:
    # The target is a step away that a float64 position of any size can tell from the eye.
    step = max(1.0, float(np.abs(position).max()))
    view = look_at_matrix(position, position + direction * step, up)
    projection = perspective_matrix(scale, scale, 0.0, 0.0, near, math.inf)
    return Camera(view=view, projection=projection, width=size, height=size)


def _directional_camera(direction: Vector, corners: Vector, size: int) -> Camera:
    centre = corners.mean(axis=0)
    radius = max(float(np.linalg.norm(corners - centre, axis=1).max()), 1e-30)
    step = max(radius, float(np.abs(centre).max()) * 1e-3)
    view = look_at_matrix(centre - direction * step, centre, _across(direction))
    view[:3, 3] = -view[:3, :3] @ (centre - direction * 2.0 * radius)
    seen = corners @ view[:3, :3].T + view[:3, 3]
    # A texel more on every side, so that filters find neighbours at the border.
    least, most = seen.min(axis=0), seen.max(axis=0)
    grow = (most - least) * (2.0 / size) + 1e-6 * radius
    least, most = least - grow, most + grow
    across, centre = most - least, most + least
    projection = orthographic_matrix(2.0 / across[0], 2.0 / across[1], radius * 0.5, radius * 3.5)
    projection[:2, 3] = -centre[:2] / across[:2]
    return Camera(view=view, projection=projection, width=size, height=size)
