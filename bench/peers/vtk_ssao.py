"""VTK's SSAO pass, drawn off-screen by OpenGL, by the size of its kernel.

The pass (Rendering/OpenGL2/vtkSSAOPass.cxx) counts which points of a hemisphere lie behind what
is drawn, and multiplies the colour of the whole picture by the share that doesn't. No gamma is
applied. A white scene whose only light is ambient, before a white background, thus shows A itself
in steps of 1/255.

VTK's points crowd towards the centre of the hemisphere, so its occlusion is that of a smaller
radius: it is too bright in wide corners however many points there are. What is seen at a slant
occludes itself, the more so the fewer pixels show it.
"""

from __future__ import annotations

import statistics
import timeit
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.scene import Scene
from ssgi_cl.rasterize.raster import opengl
from ssgi_cl.tuning.case import Family, Subject, count_of
from ssgi_cl.tuning.context import Context

from .extras import missing_package

MOST_POINTS = 1000
"""VTK's own limit of the kernel size."""

BIAS = 0.01
"""In radii: VTK's own test of the pass takes a radius of a tenth of the scene, and a bias of a
thousandth."""

PLAIN_RUNS = 5
"""Frames without SSAO that are timed for the note."""


class Picture:
    """A scene before VTK's camera, white as far as ambient occlusion leaves it so.

    Args:
        context: whose scene, camera and size it has.
        points: kernel size of the SSAO pass.

    Attributes:
        plain_ms: median time of a frame without SSAO.
    """

    def __init__(self, context: Context, points: int) -> None:
        gl = import_module("vtkmodules.vtkRenderingOpenGL2")
        core = import_module("vtkmodules.vtkRenderingCore")
        _display()
        self._size = context.size
        self._pass = gl.vtkSSAOPass()
        self._pass.SetRadius(context.radius)
        self._pass.SetBias(BIAS * context.radius)
        self._pass.SetKernelSize(points)
        self._pass.BlurOn()
        self._pass.SetDelegatePass(gl.vtkRenderStepsPass())
        self._renderer = core.vtkRenderer()
        self._renderer.SetBackground(1.0, 1.0, 1.0)
        self._renderer.AddActor(_white(core, context.view.scene))
        _aim(self._renderer.GetActiveCamera(), context)
        self._window = _window(context.size[1], context.size[0])
        self._window.AddRenderer(self._renderer)
        self.draw()  # uploads the scene
        self.plain_ms = 1e3 * statistics.median(timeit.repeat(self.draw, number=1, repeat=PLAIN_RUNS))
        self._renderer.SetPass(self._pass)

    def draw(self) -> None:
        """Draw a frame and wait for it."""
        with _quiet():
            self._window.Render()
            self._window.WaitForCompletion()

    def image(self) -> NDArray[np.float32]:
        """Return A as drawn last, [rows, columns] float32 in [0, 1]."""
        rows, columns = self._size
        pixels = import_module("vtkmodules.vtkCommonCore").vtkUnsignedCharArray()
        self._window.GetPixelData(0, 0, columns - 1, rows - 1, 1, pixels, 0)
        codes = _array(pixels).reshape(rows, columns, 3)
        return codes[::-1, :, 0].astype(np.float32) / np.float32(255.0)

    def shown(self) -> NDArray[np.bool_]:
        """Return [rows, columns], where the frame drawn last shows a surface."""
        rows, columns = self._size
        depth = import_module("vtkmodules.vtkCommonCore").vtkFloatArray()
        self._window.GetZbufferData(0, 0, columns - 1, rows - 1, depth)
        return _array(depth).reshape(rows, columns)[::-1] < 1.0


def missing() -> str:
    """Return what is missing: VTK, or a driver."""
    return missing_package("vtkmodules.vtkRenderingOpenGL2", "peers") or _display()[1]


def occlusion(context: Context, setting: str) -> Subject:
    """Upload the scene, and time it without SSAO; the setting is the number of points per pixel."""
    points = count_of(setting, "points per pixel", 1, MOST_POINTS)
    picture = Picture(context, points)
    picture.draw()
    return Subject(
        run=picture.draw,
        image=picture.image,
        on_device=False,
        quantity="occlusion",
        samples=float(points) * context.surface_pixels,
        truths={"world": context.occlusion},
        note=f"the whole frame; without SSAO it takes {picture.plain_ms:.1f} ms",
    )


def _white(core: Any, scene: Scene) -> Any:
    """Return an actor of the scene's triangles and normals that reflects ambient light alone."""
    data = import_module("vtkmodules.vtkCommonDataModel")
    numpy_to_vtk = import_module("vtkmodules.util.numpy_support").numpy_to_vtk
    points = import_module("vtkmodules.vtkCommonCore").vtkPoints()
    points.SetData(numpy_to_vtk(scene.positions, deep=True))
    triangles = data.vtkCellArray()
    triangles.SetData(3, numpy_to_vtk(scene.triangles.ravel(), deep=True))
    mesh = data.vtkPolyData()
    mesh.SetPoints(points)
    mesh.SetPolys(triangles)
    mesh.GetPointData().SetNormals(numpy_to_vtk(scene.normals, deep=True))
    mapper = core.vtkPolyDataMapper()
    mapper.SetInputData(mesh)
    actor = core.vtkActor()
    actor.SetMapper(mapper)
    surface = actor.GetProperty()
    surface.SetColor(1.0, 1.0, 1.0)
    surface.SetAmbient(1.0)  # lighting stays on, for without it VTK leaves out the normals
    surface.SetDiffuse(0.0)
    surface.SetSpecular(0.0)
    return actor


def _aim(camera: Any, context: Context) -> None:
    """Give VTK's camera our view, from the scene's origin like the positions, and projection."""
    ours = context.camera
    turn = ours.view[:3, :3]
    eye = ours.position - context.view.scene.origin
    camera.SetPosition(*eye)
    camera.SetFocalPoint(*(eye - turn[2]))
    camera.SetViewUp(*turn[1])
    matrix = import_module("vtkmodules.vtkCommonMath").vtkMatrix4x4()
    matrix.DeepCopy(opengl.clip_matrix(ours).ravel())
    camera.SetExplicitProjectionTransformMatrix(matrix)
    camera.UseExplicitProjectionTransformMatrixOn()


def _array(values: Any) -> NDArray[Any]:
    """Return what an array of VTK's holds."""
    found: NDArray[Any] = import_module("vtkmodules.util.numpy_support").vtk_to_numpy(values)
    return found


def _window(width: int, height: int) -> Any:
    """Return a window that is not shown and has one sample a pixel."""
    gl = import_module("vtkmodules.vtkRenderingOpenGL2")
    # Asked for by name: the general kind first tries for a display, and complains.
    window = gl.vtkEGLRenderWindow()
    window.OffScreenRenderingOn()
    window.SetMultiSamples(0)
    window.SetSize(width, height)
    return window


@cache
def _display() -> tuple[Any, str]:
    """Return a window that lives as long as the process, and why there is none.

    With its last window VTK ends the EGL display, and so the contexts of everybody else.
    """
    window = None
    try:
        with _quiet():
            window = _window(1, 1)
            works = window.SupportsOpenGL()
            if works:
                window.Render()
    except AttributeError:
        works = False  # this VTK is built without EGL
    if works:
        return window, ""
    return None, "vtk finds no OpenGL driver with EGL (Debian: libegl1 libgl1-mesa-dri)"


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep VTK from writing warnings to the terminal."""
    logger = import_module("vtkmodules.vtkCommonCore").vtkLogger
    before = logger.GetCurrentVerbosityCutoff()
    logger.SetStderrVerbosity(logger.VERBOSITY_OFF)
    try:
        yield
    finally:
        logger.SetStderrVerbosity(before)


FAMILIES = {"vtk-ssao": Family(occlusion, ("32", "64", "256"), missing=missing)}
