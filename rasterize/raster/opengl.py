"""The same G-buffer through OpenGL: pyrender's off-screen context, our shaders, float32 targets.

Depth doesn't come from the rasteriser's interpolation but from each triangle's plane, found in
float64 and evaluated at the pixel centre, so that it is good to a few units in the last place.
"""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.errors import SsgiError
from ssgi_cl.core.scene import Scene, Wrap, mean_emission
from ssgi_cl.rasterize.raster.opengl_context import context
from ssgi_cl.rasterize.raster.raster_view import PEEL, PEEL_ROUNDING, back_area

PEEL_FACTOR = 1.0 + PEEL
"""A surface belongs to the next layer if it is deeper than the layer before by this factor; orthographic cameras have
a difference in place of it, see `raster_view`."""

_TABLE_WIDTH = 2048  # texels in a row of the triangle table; every driver allows this many
_STEEPEST = 1e30  # bound of a plane's slopes, so that slope times 0 pixels is 0 and not NaN

_VERTEX = """#version 330 core
layout(location = 0) in vec3 position_view;
layout(location = 1) in vec3 normal_world;
layout(location = 2) in vec2 uv;
layout(location = 3) in vec3 color;
uniform mat4 u_clip;             // view to clip space; row 0 is at the bottom, as OpenGL counts
out vec3 v_normal_world;
out vec2 v_uv;
out vec3 v_color;

void main()
{
    v_normal_world = normal_world;
    v_uv = vec2(uv.x, 1.0 - uv.y);  // row 0 of a texture is on top
    v_color = color;
    gl_Position = u_clip * vec4(position_view, 1.0);
}
"""

_FRAGMENT = """#version 330 core
in vec3 v_normal_world;
in vec2 v_uv;
in vec3 v_color;
uniform sampler2D u_triangles;   // two texels for each triangle: see _triangle_table
uniform sampler2D u_before;      // the layer before: normal, linear depth
uniform sampler2D u_texture;
uniform int u_first;             // index of the draw call's first triangle
uniform int u_columns;           // triangles in a row of the table
uniform int u_perspective;       // 1: the table holds 1 / depth, 0: depth
uniform float u_peel_factor;     // 0 for the first layer
uniform float u_peel_more;       // scene units
uniform float u_depth_scale;     // a power of two that brings every depth below 1
uniform int u_textured;
uniform vec4 u_albedo;           // linear reflectance, opacity
uniform float u_cutoff;
uniform float u_material;        // index + 1; 0 is left for "nothing there"
layout(location = 0) out vec4 normal_depth;
layout(location = 1) out vec4 albedo_material;

void main()
{
    vec4 texel = u_textured != 0 ? texture(u_texture, v_uv) : vec4(1.0);
    // From the finest level: a cut-out keeps its shape at any distance.
    float alpha = u_textured != 0 ? textureLod(u_texture, v_uv, 0.0).a * u_albedo.a : u_albedo.a;

    int index = u_first + gl_PrimitiveID;
    ivec2 place = ivec2(2 * (index % u_columns), index / u_columns);
    vec4 plane = texelFetch(u_triangles, place, 0);
    vec4 bounds = texelFetch(u_triangles, place + ivec2(1, 0), 0);
    float value = dot(plane.xy, gl_FragCoord.xy - bounds.xy) + plane.z;
    value = clamp(value, bounds.z, bounds.w);
    float depth = u_perspective != 0 ? 1.0 / value : value;

    if (alpha < u_cutoff || !(depth > 0.0))
        discard;
    if (u_peel_factor > 0.0) {
        float before = texelFetch(u_before, ivec2(gl_FragCoord.xy), 0).w;
        if (!(depth > before * u_peel_factor + u_peel_more))
            discard;
    }
    float length_squared = dot(v_normal_world, v_normal_world);
    float scale = length_squared > 0.0 ? inversesqrt(length_squared) : 0.0;
    normal_depth = vec4(v_normal_world * scale, depth);
    albedo_material = vec4(min(u_albedo.rgb * v_color * texel.rgb, vec3(1.0)), u_material);
    gl_FragDepth = depth * u_depth_scale;
}
"""


def gbuffer_arrays(scene: Scene, camera: Camera, layers: int = 1) -> dict[str, NDArray[np.float32]]:
    """Draw `scene` as `camera` sees it.

    Args:
        scene: the triangles; the backs of those that lack one are culled.
        camera: any; an orthographic one sees nothing behind its own plane.
        layers: depth layers from front to back, 1 to 16. A surface belongs to the next layer if it
            is deeper than the layer before by more than a factor of 1 + 1e-5.

    Returns:
        "depth" [layers, rows, columns] float32, linear, scene units, +inf where nothing is there;
        "normal" [layers, rows, columns, 3] float32, world space, unit length, as the mesh says;
        "albedo" likewise, linear, in [0, 1]; "emission" likewise, W m^-2 sr^-1, of a
            texture its mean; of a glossy scene
        "specular" [rows, columns, 3] and "gloss" [rows, columns] of the front layer. All are 0
        where nothing is there.

    Raises:
        MissingExtraError: pyrender, EGL or an OpenGL 3.3 driver is missing.
        SsgiError: the driver refuses the image's size.
    """
    layers = checks.integer("layers", layers, low=1, high=16)
    rows, columns = camera.size
    depth = np.full((layers, rows, columns), np.inf, np.float32)
    normal, albedo, emission = (np.zeros((layers, rows, columns, 3), np.float32) for _ in range(3))
    glow = np.array([(0.0, 0.0, 0.0), *(mean_emission(scene, m) for m in scene.materials)], np.float32)
    lobes = np.array([(0.0,) * 4, *((*m.specular, m.gloss) for m in scene.materials)], np.float32)
    mirrored: dict[str, NDArray[np.float32]] = {}
    with context() as gl:
        draw = _Drawing(gl, scene, camera)
        for layer in range(layers):
            normal_depth, albedo_material = draw.layer(layer)
            material = albedo_material[..., 3].astype(np.int32)
            there = material > 0
            if layer == 0 and any(m.is_glossy for m in scene.used_materials):
                seen = lobes[material]
                mirrored = {"specular": seen[..., :3].copy(), "gloss": seen[..., 3].copy()}
            if not there.any():
                break  # nor is there anything deeper
            depth[layer] = np.where(there, normal_depth[..., 3], np.inf)
            normal[layer] = normal_depth[..., :3]
            albedo[layer] = albedo_material[..., :3]
            if glow.any():
                emission[layer] = glow[material]
    return {"depth": depth, "normal": normal, "albedo": albedo, "emission": emission, **mirrored}


class _Drawing:
    """A scene on the device, to be drawn layer by layer; freed with the context."""

    def __init__(self, gl: Any, scene: Scene, camera: Camera) -> None:
        self._gl = gl
        self._size = camera.size
        order = np.argsort(scene.material_ids, kind="stable")
        triangles = scene.triangles[order]
        ids = scene.material_ids[order]
        starts = np.flatnonzero(np.diff(ids, prepend=-1))
        self._runs = [
            (scene.materials[ids[start]], int(ids[start]), int(start), int(end - start))
            for start, end in zip(starts, [*starts[1:], len(ids)], strict=True)
        ]
        positions = _view_positions(scene, camera)
        table, deepest = _triangle_table(positions[triangles], camera)

        self._program = _program(gl)
        gl.glUseProgram(self._program)
        self._set("u_clip", np.diag([1.0, -1.0, 1.0, 1.0]) @ clip_matrix(camera))
        self._set("u_columns", _TABLE_WIDTH // 2)
        self._set("u_perspective", int(not camera.is_orthographic))
        self._set("u_peel_more", PEEL * camera.view_height if camera.is_orthographic else 0.0)
        self._peel_factor = 1.0 + PEEL_ROUNDING if camera.is_orthographic else PEEL_FACTOR
        self._set("u_depth_scale", 2.0 ** -math.frexp(deepest)[1])
        for unit, name in enumerate(("u_triangles", "u_before", "u_texture")):
            self._set(name, unit)

        gl.glPixelStorei(gl.GL_UNPACK_ALIGNMENT, 1)
        gl.glPixelStorei(gl.GL_PACK_ALIGNMENT, 1)
        gl.glBindVertexArray(gl.glGenVertexArrays(1))
        arrays = (positions.astype(np.float32), scene.normals, scene.uvs, scene.colors)
        for location, array in enumerate(arrays):
            self._buffer(gl.GL_ARRAY_BUFFER, array)
            gl.glEnableVertexAttribArray(location)
            gl.glVertexAttribPointer(location, array.shape[1], gl.GL_FLOAT, gl.GL_FALSE, 0, ctypes.c_void_p(0))
        self._buffer(gl.GL_ELEMENT_ARRAY_BUFFER, triangles)
        self._table = self._image(table, gl.GL_RGBA32F, gl.GL_FLOAT)
        used = {material.texture for material, *_ in self._runs} - {-1}
        self._textures = {index: self._mipmapped(scene.textures[index], scene.wraps[index]) for index in sorted(used)}

        rows, columns = self._size
        self._targets = [self._image((rows, columns), gl.GL_RGBA32F, gl.GL_FLOAT) for _ in "abc"]
        self._framebuffer = gl.glGenFramebuffers(1)
        gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, self._framebuffer)
        depth = self._image((rows, columns), gl.GL_DEPTH_COMPONENT32F, gl.GL_FLOAT)
        self._attach(gl.GL_DEPTH_ATTACHMENT, depth)
        self._attach(gl.GL_COLOR_ATTACHMENT1, self._targets[2])
        gl.glDrawBuffers(2, [gl.GL_COLOR_ATTACHMENT0, gl.GL_COLOR_ATTACHMENT1])
        gl.glViewport(0, 0, columns, rows)
        gl.glEnable(gl.GL_DEPTH_TEST)
        gl.glDepthFunc(gl.GL_LESS)
        # The image is upside down, so that its row 0 is on top.
        gl.glFrontFace(gl.GL_CW if back_area(camera) > 0 else gl.GL_CCW)

    def layer(self, number: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Draw the layers in order, from 0.

        Returns:
            [rows, columns, 4] float32 each: normal and depth; albedo and index of the material + 1.
        """
        gl = self._gl
        target, before = self._targets[number % 2], self._targets[1 - number % 2]
        self._attach(gl.GL_COLOR_ATTACHMENT0, target)
        if gl.glCheckFramebufferStatus(gl.GL_FRAMEBUFFER) != gl.GL_FRAMEBUFFER_COMPLETE:
            rows, columns = self._size
            raise SsgiError(f"the OpenGL driver refuses float32 targets of {columns} x {rows} px")
        gl.glClearBufferfv(gl.GL_COLOR, 0, np.array([0, 0, 0, np.inf], np.float32))
        gl.glClearBufferfv(gl.GL_COLOR, 1, np.zeros(4, np.float32))
        gl.glClearBufferfv(gl.GL_DEPTH, 0, np.ones(1, np.float32))
        self._set("u_peel_factor", self._peel_factor if number else 0.0)
        self._bind(0, self._table)
        self._bind(1, before)
        for material, index, start, count in self._runs:
            self._set("u_first", start)
            self._set("u_textured", int(material.texture >= 0))
            self._set("u_albedo", (*material.albedo, material.alpha))
            self._set("u_cutoff", material.alpha_cutoff)
            self._set("u_material", index + 1.0)
            (gl.glDisable if material.double_sided else gl.glEnable)(gl.GL_CULL_FACE)
            self._bind(2, self._textures.get(material.texture, self._table))
            offset = ctypes.c_void_p(start * 3 * 4)
            gl.glDrawElements(gl.GL_TRIANGLES, 3 * count, gl.GL_UNSIGNED_INT, offset)
        return self._read(gl.GL_COLOR_ATTACHMENT0), self._read(gl.GL_COLOR_ATTACHMENT1)

    def _read(self, attachment: int) -> NDArray[np.float32]:
        gl = self._gl
        rows, columns = self._size
        pixels = np.empty((rows, columns, 4), np.float32)
        gl.glReadBuffer(attachment)
        gl.glReadPixels(0, 0, columns, rows, gl.GL_RGBA, gl.GL_FLOAT, pixels)
        return pixels

    def _set(self, name: str, value: int | float | tuple[float, ...] | NDArray[Any]) -> None:
        gl = self._gl
        place = gl.glGetUniformLocation(self._program, name)
        if isinstance(value, int):
            gl.glUniform1i(place, value)
        elif isinstance(value, float):
            gl.glUniform1f(place, value)
        elif isinstance(value, tuple):
            gl.glUniform4f(place, *value)
        else:
            gl.glUniformMatrix4fv(place, 1, gl.GL_TRUE, value.astype(np.float32))

    def _bind(self, unit: int, texture: int) -> None:
        self._gl.glActiveTexture(self._gl.GL_TEXTURE0 + unit)
        self._gl.glBindTexture(self._gl.GL_TEXTURE_2D, texture)

    def _attach(self, attachment: int, texture: int) -> None:
        kind = self._gl.GL_TEXTURE_2D
        self._gl.glFramebufferTexture2D(self._gl.GL_FRAMEBUFFER, attachment, kind, texture, 0)

    def _buffer(self, target: int, array: NDArray[Any]) -> None:
        gl = self._gl
        gl.glBindBuffer(target, gl.glGenBuffers(1))
        gl.glBufferData(target, array.nbytes, np.ascontiguousarray(array), gl.GL_STATIC_DRAW)

    def _image(self, content: NDArray[Any] | tuple[int, int], inner: int, kind: int) -> int:
        """Make an unfiltered texture [rows, columns, 4] of an array or, empty, of a size."""
        gl = self._gl
        texture: int = gl.glGenTextures(1)
        rows, columns = content if isinstance(content, tuple) else content.shape[:2]
        outer = gl.GL_DEPTH_COMPONENT if inner == gl.GL_DEPTH_COMPONENT32F else gl.GL_RGBA
        pixels = None if isinstance(content, tuple) else content
        self._bind(2, texture)
        gl.glTexImage2D(gl.GL_TEXTURE_2D, 0, inner, columns, rows, 0, outer, kind, pixels)
        for parameter in (gl.GL_TEXTURE_MIN_FILTER, gl.GL_TEXTURE_MAG_FILTER):
            gl.glTexParameteri(gl.GL_TEXTURE_2D, parameter, gl.GL_NEAREST)
        return texture

    def _mipmapped(self, pixels: NDArray[np.uint8], wrap: Wrap) -> int:
        """Make a texture with trilinear filter in linear light."""
        gl = self._gl
        content = np.ascontiguousarray(pixels)
        texture = self._image(content, gl.GL_SRGB8_ALPHA8, gl.GL_UNSIGNED_BYTE)
        kinds = {"repeat": gl.GL_REPEAT, "clamp": gl.GL_CLAMP_TO_EDGE, "mirror": gl.GL_MIRRORED_REPEAT}
        gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_WRAP_S, kinds[wrap[0]])
        gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_WRAP_T, kinds[wrap[1]])
        gl.glGenerateMipmap(gl.GL_TEXTURE_2D)
        gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_MIN_FILTER, gl.GL_LINEAR_MIPMAP_LINEAR)
        gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_MAG_FILTER, gl.GL_LINEAR)
        return texture


def _program(gl: Any) -> int:
    program: int = gl.glCreateProgram()
    for kind, source in ((gl.GL_VERTEX_SHADER, _VERTEX), (gl.GL_FRAGMENT_SHADER, _FRAGMENT)):
        shader = gl.glCreateShader(kind)
        gl.glShaderSource(shader, source)
        gl.glCompileShader(shader)
        gl.glAttachShader(program, shader)
    gl.glLinkProgram(program)  # fails too if a shader did not compile, and the log says why
    if not gl.glGetProgramiv(program, gl.GL_LINK_STATUS):
        log = gl.glGetProgramInfoLog(program)
        raise SsgiError(f"the OpenGL driver does not accept GLSL 3.30: {log!r}")
    return program


def _view_positions(scene: Scene, camera: Camera) -> NDArray[np.float64]:
    """Return [vertices, 3] float64 in view space; the large numbers cancel before any rounding."""
    turn, shift = camera.view[:3, :3], camera.view[:3, 3]
    positions: NDArray[np.float64] = scene.positions @ turn.T + (turn @ scene.origin + shift)
    return positions


def clip_matrix(camera: Camera) -> NDArray[np.float64]:
    """Return OpenGL's own projection of `camera`: near and far plane at -1 and 1, not reversed."""
    matrix = camera.projection.copy()
    near, far = camera.near, camera.far
    if camera.is_orthographic:
        near = max(near, 0.0)
        matrix[2] = 0.0, 0.0, -2.0 / (far - near), -(far + near) / (far - near)
    else:
        ratio = near / far  # 0 for an infinite far plane
        matrix[2] = 0.0, 0.0, -(1.0 + ratio) / (1.0 - ratio), -2.0 * near / (1.0 - ratio)
    return matrix


def _triangle_table(corners: NDArray[np.float64], camera: Camera) -> tuple[NDArray[np.float32], float]:
    """Tabulate what the fragment shader needs to know of each triangle.

    Args:
        corners: [triangles, 3, 3] float64, view space.
        camera: the camera.

    Returns:
        [rows, 2048, 4] float32, two texels for each triangle: slope to the right, slope downwards,
        value at a reference pixel, 0; column and row of that pixel, least and greatest value. The
        value is 1 / depth (perspective) or depth (orthographic): both are linear in the image.
        And the greatest depth that can be seen, > 0.
    """
    sx, sy, ox, oy = camera.pixel_to_view
    height, width = camera.size
    deep = -corners[..., 2]
    shallowest = max(camera.near, 0.0)
    low = np.clip(deep.min(axis=1), shallowest, camera.far)
    high = np.clip(deep.max(axis=1), shallowest, camera.far)
    farthest = np.take_along_axis(corners, deep.argmax(axis=1)[:, None, None], axis=1)[:, 0]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    offset = np.einsum("ij,ij->i", normal, farthest)
    k = np.ones_like(high) if camera.is_orthographic else np.maximum(-farthest[:, 2], shallowest)
    column = np.clip(np.floor((farthest[:, 0] / k - ox) / sx), 0, width - 1) + 0.5
    row = np.clip(np.floor((farthest[:, 1] / k - oy) / sy), 0, height - 1) + 0.5
    along = normal[:, 0] * (sx * column + ox) + normal[:, 1] * (sy * row + oy)
    if camera.is_orthographic:
        divisor, numerator = normal[:, 2], along - offset
    else:
        divisor, numerator = offset, along - normal[:, 2]
        low, high = 1.0 / high, 1.0 / low
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        plane = np.stack([normal[:, 0] * sx, normal[:, 1] * sy, numerator]) / divisor
    table = np.zeros((-(-len(corners) // (_TABLE_WIDTH // 2)), _TABLE_WIDTH, 4), np.float32)
    texels = table.reshape(-1, 2, 4)[: len(corners)]
    texels[:, 0, :3] = np.clip(np.nan_to_num(plane.T), -_STEEPEST, _STEEPEST)
    texels[:, 1] = np.stack([column, row, low, high], axis=1)
    smallest = max(shallowest, float(np.finfo(np.float32).tiny))
    deepest = min(max(float(deep.max()), smallest), camera.far)
    return table, deepest
