"""pyrender's own raster passes, by their name: flat colour with depth, or depth alone."""

from __future__ import annotations

import os
import statistics
import timeit
import weakref
from importlib import import_module
from typing import Any

import numpy as np
from PIL import Image

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import MissingExtraError
from ssgi_cl.core.scene import Scene
from ssgi_cl.rasterize.raster import opengl
from ssgi_cl.rasterize.raster.opengl_context import context as opengl_context
from ssgi_cl.tuning.case import Family, Subject
from ssgi_cl.tuning.context import Context

FLAGS = {"flat": "FLAT", "depth": "DEPTH_ONLY"}
"""Name of a pass -> pyrender's own."""


class Frames:
    """A scene in pyrender, to be drawn again and again.

    Args:
        scene: drawn as one mesh with a primitive for each material, which suits pyrender best.
        camera: an orthographic one is drawn like any other.
        name: of the pass, a key of `FLAGS`.

    Raises:
        MissingExtraError: pyrender, EGL or an OpenGL driver is missing.
    """

    def __init__(self, scene: Scene, camera: Camera, name: str) -> None:
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")  # else pyrender would open a window
        with opengl_context():  # explains what is missing
            pass
        pyrender = import_module("pyrender")
        self._flags = getattr(pyrender.RenderFlags, FLAGS[name])
        self._renderer = pyrender.OffscreenRenderer(camera.width, camera.height)
        self._close = weakref.finalize(self, _closed, self._renderer)
        self._scene = _pyrender_scene(pyrender, scene, camera)
        self.draw()

    def draw(self) -> Any:
        """Draw a frame and return what pyrender reads back: colour and depth, or depth alone."""
        return self._renderer.render(self._scene, self._flags)

    def close(self) -> None:
        """Free what OpenGL holds; also done when the object is no longer used."""
        self._close()


def median_ms(scene: Scene, camera: Camera, name: str, repeats: int = 5) -> float:
    """Return the median time of one frame of a pass, in milliseconds.

    The time includes what pyrender always does: four samples a pixel and reading colour and depth
    back. A frame before the first measured one uploads the scene and compiles the shaders.

    Args:
        scene, camera, name: as in `Frames`.
        repeats: measured frames, >= 1.

    Raises:
        MissingExtraError: pyrender, EGL or an OpenGL driver is missing.
    """
    frames = Frames(scene, camera, name)
    seconds = timeit.repeat(frames.draw, number=1, repeat=repeats)
    frames.close()
    return 1e3 * statistics.median(seconds)


def missing() -> str:
    """Return what is missing: pyrender, or a driver."""
    try:
        with opengl_context():
            return ""
    except MissingExtraError as error:
        return " ".join(str(error).split())


def drawn(context: Context, setting: str) -> Subject:
    """Upload the scene and compile the shaders of a pass; the setting is its name."""
    frames = Frames(context.view.scene, context.camera, checks.choice("setting", setting, tuple(FLAGS)))
    return Subject(run=frames.draw, on_device=False, note="four samples a pixel, read back")


def _closed(renderer: Any) -> None:
    """Free a renderer but not the EGL display, which its own `delete` ends for everybody else."""
    egl = import_module("OpenGL.EGL")
    platform = renderer._platform
    platform.make_current()
    renderer._renderer.delete()
    import_module("OpenGL.contextdata").cleanupContext()
    display, gone = platform._egl_display, platform._egl_context
    egl.eglMakeCurrent(display, egl.EGL_NO_SURFACE, egl.EGL_NO_SURFACE, egl.EGL_NO_CONTEXT)
    egl.eglDestroyContext(display, gone)
    platform._egl_display = None  # so that its `delete` finds nothing left to do


def _pyrender_scene(pyrender: Any, scene: Scene, camera: Camera) -> Any:
    class FixedCamera(pyrender.Camera):  # type: ignore[misc]
        def get_projection_matrix(self, width: int | None = None, height: int | None = None) -> Any:
            return opengl.clip_matrix(camera)

    # Like the positions, the pose counts from the scene's origin.
    view = camera.view.copy()
    view[:3, 3] += view[:3, :3] @ scene.origin
    near = max(camera.near, 1e-6)
    result = pyrender.Scene(ambient_light=np.ones(3))
    # pyrender scales its depth image by these two numbers and wants both finite.
    eye = FixedCamera(znear=near, zfar=min(camera.far, 1e9 * near))
    result.add(eye, pose=np.linalg.inv(view))
    parts = [_primitive(pyrender, scene, index) for index in np.unique(scene.material_ids)]
    result.add(pyrender.Mesh(parts))
    return result


def _primitive(pyrender: Any, scene: Scene, index: int) -> Any:
    material = scene.materials[index]
    triangles = scene.triangles[scene.material_ids == index]
    used, indices = np.unique(triangles, return_inverse=True)
    texture = None
    if material.texture >= 0:
        source = Image.fromarray(scene.textures[material.texture])
        texture = pyrender.Texture(source=source, source_channels="RGBA")
    return pyrender.Primitive(
        positions=scene.positions[used],
        normals=scene.normals[used],
        texcoord_0=scene.uvs[used],
        indices=indices.reshape(-1, 3),
        mode=pyrender.GLTF.TRIANGLES,
        material=pyrender.MetallicRoughnessMaterial(
            baseColorFactor=(*material.albedo, material.alpha),
            baseColorTexture=texture,
            alphaMode="MASK" if material.alpha_cutoff > 0 else "OPAQUE",
            alphaCutoff=material.alpha_cutoff,
            doubleSided=True,
        ),
    )


FAMILIES = {"pyrender": Family(drawn, tuple(FLAGS), missing=missing)}
