"""What other programs need for the same work: pyrender's own renderer."""

from __future__ import annotations

import os
import time
from importlib import import_module
from typing import Any

import numpy as np
from PIL import Image

from ssgi_cl.camera import Camera
from ssgi_cl.rasterize import opengl
from ssgi_cl.rasterize.opengl_context import context
from ssgi_cl.rasterize.scene import Scene


def flat_pass_ms(scene: Scene, camera: Camera, repeats: int = 5) -> float:
    """Return the median time of one frame of pyrender's flat-shaded pass, in milliseconds.

    The time includes what pyrender always does: four samples a pixel and reading colour and depth
    back. A frame before the first measured one uploads the scene and compiles the shaders.

    Args:
        scene: drawn as one mesh with a primitive for each material, which suits pyrender best.
        camera: an orthographic one is drawn like any other.
        repeats: measured frames, >= 1.

    Raises:
        MissingExtraError: pyrender, EGL or an OpenGL driver is missing.
    """
    return _median_ms(scene, camera, repeats, "FLAT")


def depth_pass_ms(scene: Scene, camera: Camera, repeats: int = 5) -> float:
    """Return the median time of pyrender's depth-only pass; otherwise like `flat_pass_ms`."""
    return _median_ms(scene, camera, repeats, "DEPTH_ONLY")


def _median_ms(scene: Scene, camera: Camera, repeats: int, flag: str) -> float:
    os.environ.setdefault("PYOPENGL_PLATFORM", "egl")  # else pyrender would open a window
    with context():  # explains what is missing
        pass
    pyrender = import_module("pyrender")
    renderer = pyrender.OffscreenRenderer(camera.width, camera.height)
    try:
        content = _pyrender_scene(pyrender, scene, camera)
        flags = getattr(pyrender.RenderFlags, flag)
        renderer.render(content, flags)
        times = []
        for _ in range(max(1, repeats)):
            start = time.perf_counter()
            renderer.render(content, flags)
            times.append(time.perf_counter() - start)
    finally:
        renderer.delete()
    return 1e3 * float(np.median(times))


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
