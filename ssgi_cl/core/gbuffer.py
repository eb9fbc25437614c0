"""G-buffers: numpy arrays with the camera that saw them."""

from __future__ import annotations

import dataclasses
import logging
import os
from collections.abc import Iterable, Mapping
from copy import copy
from dataclasses import dataclass, field
from typing import Any, Literal, Self, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.array_kinds import ArrayKind, array_kind
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.depth_maps import read_depth
from ssgi_cl.core.formats import files
from ssgi_cl.core.gbuffer_band import Band
from ssgi_cl.core.gbuffer_batch import GBufferBatch
from ssgi_cl.core.gbuffer_exr import exr_arrays, exr_motion
from ssgi_cl.core.motion import MOST_MOTION, Residual, camera_motion, depth_residual, motion_of

Floats = NDArray[np.float32]

NAN = ("refuse", "hole")
"""Meanings of NaN in a G-buffer's arrays."""

_LIMITS: dict[str, checks.Limits] = {
    "normal": {},
    "albedo": {"low": 0.0, "high": 1.0},
    "emission": {"low": 0.0, "high": checks.MOST_LIGHT},
    "specular": {"low": 0.0, "high": 1.0},
    "gloss": {"low": 0.0, "unit": "Phong exponent"},
    "thickness": {"low": -1.0, "unit": "scene units", "infinite": True},
    "motion": {},
}
"""Arrays beside the depth, and the range of their values."""

_LOG = logging.getLogger("ssgi_cl")

_INSTEAD_OF_NAN = {"depth": np.inf, "motion": MOST_MOTION}

_FLAT = ("gloss",)
"""Arrays of one channel and of the front layer alone."""

_ONE_CHANNEL = ("depth", "gloss", "thickness")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class GBuffer:
    """The surfaces that a camera sees, pixel by pixel. Row 0 is on top; pixel centres lie at +0.5.

    Arrays may be larger than the camera's image by an even number of rows and columns: a margin
    then surrounds the image, and results have the size of the camera's image. `rasterize.gbuffer`
    draws one of `overscan` times the image's size.

    Attributes:
        camera: the camera; its size is that of the results.
        depth: [rows, columns] or [layers, rows, columns] float32, linear view depth in scene
            units, > 0; +inf where nothing is there. Layers go from front to back: none is nearer
            than the one before it. Depths below 1e-30 or above 1e30 count as these.
        normal: [rows, columns, 3] float32, world space, unit length; 0 where nothing is there.
            With None, and where it is 0 on a surface, the normal is reconstructed from depth.
            [layers, rows, columns, 3] gives the deeper layers' normals too.
        albedo: [rows, columns, 3] (or with layers) float32, linear reflectance in [0, 1]; None
            stands for 0.8 everywhere.
        emission: [rows, columns, 3] float32 radiance in W m^-2 sr^-1, in [0, 1e30], or None.
        specular: [rows, columns, 3] float32 reflectance of a Phong lobe in [0, 1], or None.
        gloss: [rows, columns] float32 exponent of that lobe, >= 0, or None.
        thickness: [rows, columns] float32, how far the front layer's surfaces reach behind what is
            seen of them along the view ray, scene units, >= 0 (+inf: without end; -1: not known), or None.
            [layers, rows, columns] gives that of the deeper layers too.
        motion: [rows, columns, 2 or 3] float32 to the previous image: previous = current + motion, in
            columns (to the right) and rows (downwards) of pixels, in [-1e6, 1e6]; and previous depth minus
            depth in scene units. 0 where nothing is; 1e6 where the previous camera cannot see it. None:
            nothing is known, surfaces stand still.
        nan: "refuse" raises ValueError for NaN; "hole" takes a NaN depth for +inf, nothing there
            (in all deeper layers too), and NaN elsewhere for 0, which for normals means that they
            are reconstructed from depth; for motion for 1e6: the previous image does not show it.
        notes: what was assumed or found of the arrays, in words; they go to the logger "ssgi_cl" too.
        array_kind: kind of array that `depth` was and that results are; None: numpy.

    Arrays may be of any library: whatever has `__dlpack__`, `__array__` or the buffer protocol.
    Results are of the kind of `depth`, float32, and on its device.

    Raises:
        TypeError: an array is not of real numbers.
        ValueError: a wrong shape, NaN, a value outside its range, or layers out of order; the
            message names the pixel.
    """

    camera: Camera
    depth: ArrayLike
    normal: ArrayLike | None = None
    albedo: ArrayLike | None = None
    emission: ArrayLike | None = None
    specular: ArrayLike | None = None
    gloss: ArrayLike | None = None
    thickness: ArrayLike | None = None
    motion: ArrayLike | None = None
    nan: Literal["refuse", "hole"] = "refuse"
    notes: tuple[str, ...] = ()
    margin: tuple[int, int] = field(init=False)
    """(rows, columns) by which the arrays exceed the camera's image on every side."""
    array_kind: ArrayKind | None = field(init=False, default=None)
    exact: bool = field(init=False, default=False)
    """Whether depths are those of a rasteriser in float32, with no rounding to steps."""
    band: Band | None = field(init=False, default=None)
    """Where these rows lie in a larger image, if they do; see `gbuffer_band`."""

    def __post_init__(self) -> None:
        if not isinstance(self.camera, Camera):
            raise TypeError(f"camera is {self.camera!r}: expected an ssgi_cl.Camera")
        object.__setattr__(self, "array_kind", array_kind(self.depth))
        for note in self.notes:
            _LOG.info("%s", note)
        if checks.choice("nan", self.nan, NAN) == "hole":
            self._fill_nan()
        depth = _depths(self.depth)
        _in_order(depth)
        self._set("depth", depth)
        margin = np.subtract(depth.shape[-2:], self.camera.size)
        if (margin < 0).any() or (margin % 2).any():
            raise ValueError(
                f"depth has {depth.shape[-2]} rows and {depth.shape[-1]} columns: expected "
                f"{self.camera.height} x {self.camera.width} as the camera, or more by an even "
                "number (a margin of equal size on opposite sides)"
            )
        object.__setattr__(self, "margin", (int(margin[0]) // 2, int(margin[1]) // 2))
        for name, limits in _LIMITS.items():
            value = getattr(self, name)
            if value is not None:
                self._set(name, self._attribute(name, value, depth.shape, limits))

    def __repr__(self) -> str:
        depth = self.first("depth")
        assert depth is not None  # noqa: S101  every G-buffer has one
        there = depth[np.isfinite(depth)]
        seen = f"depth {there.min():.3g} to {there.max():.3g}" if there.size else "nothing seen"
        held = [name for name in _LIMITS if getattr(self, name) is not None]
        lines = [
            f"GBuffer of {self.size[0]} x {self.size[1]} pixels, margin {self.margin}, {self.layers} layer(s): {seen} "
            f"on {there.size / depth.size:.0%}; {', '.join(held) or 'depth alone'}",
            *self.notes,
        ]
        return "\n  ".join(lines)

    def _repr_png_(self) -> bytes:
        """Return depth, normals and albedo side by side, for notebooks."""
        return files().gbuffer_png(self)

    def _fill_nan(self) -> None:
        """Replace the arrays that hold NaN."""
        for name in ("depth", *_LIMITS):
            value = getattr(self, name)
            array = None if value is None else checks.as_array(name, value)
            if array is None or array.dtype.kind != "f":
                continue
            missing = np.isnan(array)
            if name == "depth" and array.ndim == 3:
                missing = np.logical_or.accumulate(missing)
            if missing.any():
                self._set(name, np.where(missing, _INSTEAD_OF_NAN.get(name, 0.0), array))

    def _set(self, name: str, value: Floats) -> None:
        object.__setattr__(self, name, value)

    @staticmethod
    def _attribute(name: str, value: ArrayLike, shape: tuple[int, ...], limits: checks.Limits) -> Floats:
        """Return an array beside a depth of this shape, checked."""
        if name == "motion":
            return motion_of(value, shape[-2:])
        if name in _FLAT:
            array, shape = checks.plane(name, value, **limits), shape[-2:]
            size = array.shape
        elif name == "thickness":
            array = _layered(name, value, 0, **limits)
            size = array.shape
            if (between := (array > -1.0) & (array < 0.0)).any():
                raise ValueError(
                    f"thickness has {array[between][0]}: expected numbers >= 0 scene units, or -1 where it is not known"
                )
        else:
            array = _layered(name, value, 3, **limits)
            size = array.shape[:-1]
        if size not in (shape, shape[-2:]):
            raise ValueError(f"{name} has shape {size}: expected {shape} as the depth")
        return _unit(array) if name == "normal" else array

    @property
    def layers(self) -> int:
        """Number of depth layers."""
        depth: Floats = self.depth  # type: ignore[assignment]
        return 1 if depth.ndim == 2 else int(depth.shape[0])

    @property
    def size(self) -> tuple[int, int]:
        """(rows, columns) of the camera's image, which is that of every result."""
        return self.camera.size

    def first(self, name: str) -> Floats | None:
        """Return the front layer of the array called `name`, margin included, or None."""
        array = getattr(self, name)
        if array is None:
            return None
        flat = 2 if name in _ONE_CHANNEL else 3
        result: Floats = array if array.ndim == flat else array[0]
        return result

    def inner(self, array: Floats) -> Floats:
        """Return `array` [rows, columns, ...] without the margin (a view)."""
        rows, columns = self.margin
        return array[rows : array.shape[0] - rows, columns : array.shape[1] - columns]

    def with_motion(self, previous: Camera) -> Self:
        """Return this G-buffer with the motion of surfaces that stand still, in place of any that it has.

        Args:
            previous: the camera of the previous image.
        """
        depth = self.first("depth")
        assert depth is not None  # noqa: S101  every G-buffer has one
        other = copy(self)
        other._set("motion", camera_motion(depth, self.camera, previous))
        return other

    def motion_residual(self, previous: GBuffer) -> Residual:
        """Return how well the motion fits the depth of the previous G-buffer.

        Without `motion`, it is that of surfaces that stand still. What was hidden in the previous image counts as
        well: a few per cent of the pixels never fit.

        Raises:
            ValueError: no pixel of the previous image is met.
        """
        return depth_residual(self, previous)

    def of_kind(self, value: Any) -> Self:
        """Return a G-buffer of the same arrays whose results are arrays of the kind of `value`."""
        other = copy(self)
        object.__setattr__(other, "array_kind", array_kind(value))
        return other

    @classmethod
    def from_depth(
        cls,
        depth: Any,
        *,
        K: ArrayLike | None = None,
        K_unit: Literal["pixels", "corner", "image"] = "pixels",
        yfov: float | None = None,
        orthographic: float | None = None,
        camera: Camera | Iterable[Camera] | None = None,
        view: ArrayLike | None = None,
        kind: Literal["planar", "ray", "inverse", "relative"] = "planar",
        scale: float | None = None,
        shift: float | None = None,
        invalid: Iterable[float] | None = None,
        normal: Any = None,
        normal_space: str | None = None,
        color: Any = None,
        layout: Literal["HWC", "CHW"] = "HWC",
    ) -> GBuffer | GBufferBatch:
        """Make a G-buffer of a depth map, predicted or measured; of several, a batch.

        Args:
            depth: [rows, columns], or [images, rows, columns] for a batch; real numbers.
            K: intrinsics, fx, fy, cx, cy or a 3 x 3 matrix, in pixels as in OpenCV: the centre of the
                first pixel is (0, 0). Or one for each image.
            K_unit: "corner" where the corner of the first pixel is (0, 0), as of COLMAP and nerfstudio; "image"
                in units of the image's width and height, as of MoGe.
            yfov: vertical field of view in radians, in place of K.
            orthographic: height of an orthographic view in scene units, in place of K.
            camera: of the depth, in place of K; or one for each image. Without any of the four, a
                field of view of 50 degrees is assumed, and warned of.
            view: [4, 4] world to view, as of `Camera`; the identity by default. Or one for each image.
            kind: "planar": distance to the camera's plane; "ray": distance to the eye; "inverse": its
                planar depth is scale / value (inverse depth, or disparity with `scale` = focal length
                times baseline); "relative": 1 / depth = scale * value + shift, the nearer the larger,
                as of networks for relative depth.
            scale: scene units of the number 1. Without, 1; of integers .001 is assumed, and warned of; of
                relative depth, numbers that reach from 1 to 10 scene units, likewise.
            shift: of relative depth; 0 by default, if there is a scale.
            invalid: numbers that stand for no surface: by default 0, NaN, +inf and 1e10, of relative depth
                NaN, +inf and 1e10.
            normal: [rows, columns, 3] of any length, in 0..1 or signed.
            normal_space: "camera" (+y up, +z towards the viewer), "opencv" (+y down, +z forward), "camera, y
                down", "camera, z forward" or "world", with ", 0..1" where they are stored as (n + 1) / 2. None
                finds out, by holding them to normals of the depth, and says it in `notes`; world axes are found
                without `camera` and `view` too.
            color: [rows, columns, 3], taken for reflectance: integers are sRGB, floats linear in [0, 1].
            layout: "CHW" where channels come before rows and columns, in all arrays.

        Returns:
            A `GBuffer`, or a `GBufferBatch` for [images, rows, columns]. Results of techniques are arrays of the
            kind of `depth`.

        Raises:
            ValueError: a depth that is neither above 0 nor listed in `invalid`, a wrong shape, or normals whose
                space is not clear (`UnclearSpaceError`; the message has the two best and their residuals).
            TypeError: an array is not of real numbers.
        """
        fields, is_batch = read_depth(
            depth,
            K=K,
            K_unit=K_unit,
            yfov=yfov,
            orthographic=orthographic,
            camera=camera,
            view=view,
            kind=kind,
            scale=scale,
            shift=shift,
            invalid=invalid,
            normal=normal,
            normal_space=normal_space,
            color=color,
            layout=layout,
        )
        made = [cls(**each).of_kind(depth) for each in fields]
        return GBufferBatch(made) if is_batch else made[0]

    @classmethod
    def from_exr(
        cls,
        path: str | os.PathLike[str],
        *,
        camera: Camera | None = None,
        layout: str | None = None,
        channels: Mapping[str, str | tuple[str, ...]] | None = None,
        layer: str | None = None,
        part: str | None = None,
        normal_space: str | None = None,
        depth_kind: str | None = None,
        depth_range: tuple[float, float] | None = None,
        motion_kind: Literal["pixels", "blender", "nuke", "ndc"] | None = None,
        previous: GBuffer | None = None,
        nan: Literal["refuse", "hole"] = "refuse",
    ) -> Self:
        """Read a G-buffer from an OpenEXR file.

        Args:
            path: the file.
            camera: the camera that saw it, of the file's display window or of its data window
                (`Camera.cropped`); by default the one in its header: worldToCamera with worldToNDC, or
                attributes of Arnold, V-Ray, Redshift and Unreal.
            layout: program whose conventions the file has: "blender", "arnold", "v-ray", "redshift", "karma",
                "renderman", "unreal", "nuke" or "hydra"; guessed by default. It decides where several names
                would do, and where depth and normals do not tell.
            channels: channel names for `depth`, `normal`, `albedo`, `emission`, `motion`, for example
                {"depth": "Z", "normal": ("N.X", "N.Y", "N.Z")}; found by their usual names if not
                given. `notes` says what was read, and what was not.
            layer: whose channels are read, such as "ViewLayer"; by default the one with a depth that has
                the most of the four.
            part: of a file of several parts, the one that is read; by default all.
            normal_space: as of `from_depth`. None finds out; where too few surfaces are smooth to tell,
                normals are taken for those of the world.
            depth_kind: "planar" along the camera's axis, "ray" along the view ray, "inverse" for 1 / planar
                depth, "normalised" for OpenGL's 0..1 between the near and far plane of `camera`, or "remapped".
                By default one of the first three, found by planes, on which 1 / planar depth is linear.
            depth_range: depths of the values 0 and 1 of "remapped" depth, scene units, as V-Ray's black and white.
            motion_kind: convention of the motion, which is read if this or `previous` is given: "blender", its pass
                Vector (previous - current, pixels, y up); "nuke", forward (next - current, pixels, y up), for motion
                that goes on evenly; "ndc", previous - current from -1 to 1 across the image, y up; "pixels", as
                `to_exr` writes it. By default the one that leads to the depths of `previous`.
            previous: the G-buffer of the frame before. The motion is held to its depth; `notes` has the residual.
            nan: as the attribute.

        Raises:
            ValueError: not an EXR file, damaged, without depth, without a camera in the header where none is given,
                depth in 0..1 whose kind has to be said, of another size than `camera`, or,
                with a camera of the display window, the data window does not exceed that equally
                on opposite sides (the margin); several layers have a depth and none is named; or the
                space of the normals is not clear (`UnclearSpaceError`); the file has no motion that is asked for, or
                another convention of it fits `previous` clearly better.
        """
        read = exr_arrays(
            path,
            camera,
            channels,
            layer=layer,
            part=part,
            layout=layout,
            normal_space=normal_space,
            depth_kind=depth_kind,
            depth_range=depth_range,
        )
        result = cls(nan=nan, **read)
        if motion_kind is None and previous is None:
            return result
        names = (channels or {}).get("motion")
        return result._with_motion_of(os.fspath(path), names, layer, part, motion_kind, previous)

    def _with_motion_of(
        self,
        path: str,
        names: str | tuple[str, ...] | None,
        layer: str | None,
        part: str | None,
        kind: str | None,
        previous: GBuffer | None,
    ) -> Self:
        """Return this G-buffer with the motion of an OpenEXR file; arguments as of `from_exr`."""
        motion, note = exr_motion(path, self, names, layer=layer, part=part, kind=kind, previous=previous, nan=self.nan)
        fields: dict[str, Any] = {**{f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.init}}
        return type(self)(**{**fields, "motion": motion, "notes": (*self.notes, note)})

    def save(self, path: str | os.PathLike[str], *, half: bool = False, parts: bool = False) -> None:
        """Write the front layer as `to_exr` does. ValueError: the name does not end in .exr."""
        if not os.fspath(path).lower().endswith(".exr"):
            raise ValueError(f"path is {os.fspath(path)!r}: expected a name that ends in .exr")
        self.to_exr(path, half=half, parts=parts)

    def to_exr(
        self,
        path: str | os.PathLike[str],
        *,
        like: str | os.PathLike[str] | None = None,
        half: bool = False,
        parts: bool = False,
    ) -> None:
        """Write the front layer to an OpenEXR file that `from_exr` reads; whole or not at all.

        Channels are Z, N.X, N.Y, N.Z (world space), albedo.R ..., emission.R ... and motion.X ...; the header has the
        camera (worldToCamera, worldToNDC), and the margin lies outside of the display window.

        Args:
            path: the file.
            like: a file of the same size whose windows, camera and other attributes are kept instead.
            half: whether channels but Z are half floats.
            parts: whether each array is a part of its own.

        Raises:
            ValueError: `like` is of another size, or a value is beyond the largest half float, 65504.
            OSError: the file can't be written.
        """
        names = ("depth", "normal", "albedo", "emission")
        arrays = {name: self.first(name) for name in names}
        kept = {name: array for name, array in arrays.items() if array is not None}
        motion = self.first("motion")
        if motion is not None:
            kept |= {f"motion.{'XYZ'[i]}": motion[..., i] for i in range(motion.shape[2])}
        files().write(path, kept, like=like, camera=self.camera, half=half, parts=parts)


def _layered(name: str, value: ArrayLike, channels: int, **limits: Unpack[checks.Limits]) -> Floats:
    array = checks.as_array(name, value)
    flat = 3 if channels else 2
    if array.ndim == flat + 1 and array.shape[0] > 0:
        array = checks.floats(name, array)
        if channels and array.shape[-1] != channels:
            raise ValueError(f"{name} has shape {array.shape}: expected {channels} channels")
        checks.values_in_range(name, array, **limits)
        return array
    return checks.plane(name, array, channels=channels, **limits)


def _depths(value: ArrayLike) -> Floats:
    """Return depths, checked."""
    try:
        return _layered("depth", _limited(value), 0, unit="scene units", low=0.0, above=True, infinite=True)
    except ValueError as error:
        if "expected numbers > 0" not in str(error):
            raise
        raise ValueError(
            f"{error}; where it stands for no surface, GBuffer.from_depth(invalid=...), nan='hole', or --invalid and "
            "--nan hole of `ssgi apply`, take it for that"
        ) from None


def _in_order(depth: Floats) -> None:
    """Raise ValueError where a layer is nearer than the one before it."""
    if depth.ndim == 2:
        return
    for layer in range(1, len(depth)):
        wrong = depth[layer] < depth[layer - 1]
        if wrong.any():
            row, column = (int(i) for i in np.unravel_index(int(np.argmax(wrong)), wrong.shape))
            raise ValueError(
                f"depth[{layer}, {row}, {column}] is {depth[layer, row, column]}: expected at "
                f"least that of layer {layer - 1} there, {depth[layer - 1, row, column]} (scene "
                "units); layers go from front to back (several images are a GBufferBatch)"
            )


def _limited(depth: ArrayLike) -> NDArray[Any]:
    """Return depths within the limits of `checks`; the same array if they are.

    What is infinite, NaN or not above 0 stays as it is. Float64 is limited before it is rounded.
    """
    array = checks.as_array("depth", depth)
    if array.dtype.kind != "f" or array.size == 0:
        return array
    least, most = np.float32(checks.LEAST_DEPTH), np.float32(checks.MOST_DEPTH)
    far, near = array > most, array < least
    if not (near.any() or np.isfinite(array[far]).any()):
        return array
    far, near = far & (array < np.inf), near & (array > 0.0)
    return np.where(far, most, np.where(near, least, array))


def _unit(normal: Floats) -> Floats:
    """Return normals of length 1 or 0; the same array where they are so already."""
    squared = np.einsum("...i,...i->...", normal, normal)
    # The square of a length below 1e-19 is 0 in float32.
    wrong = (np.abs(squared - 1.0) > 1e-5) & ((squared != 0.0) | normal.any(axis=-1))
    if not wrong.any() and np.isfinite(squared).all():
        return normal
    wide = normal.astype(np.float64)
    length = np.linalg.norm(wide, axis=-1, keepdims=True)
    scaled: Floats = (wide / np.where(length > 0.0, length, 1.0)).astype(np.float32)
    return scaled
