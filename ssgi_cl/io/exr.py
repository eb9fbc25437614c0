"""OpenEXR files: linear float32 channels with conventional names."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence, Set
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import ArrayLike, NDArray

from ssgi_cl.core import atomic, checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.io.exr_camera import HeaderCamera, camera_attributes, header_camera
from ssgi_cl.io.exr_channels import QUANTITIES, found_channels, stem_of
from ssgi_cl.io.exr_header import ExrHeader, Window, read_headers
from ssgi_cl.io.exr_layouts import layout_of
from ssgi_cl.io.exr_motion import motion_channels
from ssgi_cl.io.exr_rows import read_rows, utf8, write_rows

BACKGROUND_DEPTH = 1e10
"""Depths from here on mean that nothing is there: Blender writes 1e10 for its background."""

_STEMS = {"": "", "image": "", "normal": "N"}
_SINGLES = {"depth": "Z"}
_PARTS = {"": "rgba", "image": "rgba", "normal": "N"}
_SUFFIXES = {"normal": ("X", "Y", "Z")}


def write(
    path: str | os.PathLike[str],
    arrays: Mapping[str, ArrayLike],
    *,
    data: Window | None = None,
    display: Window | None = None,
    like: str | os.PathLike[str] | None = None,
    camera: Camera | None = None,
    attributes: Mapping[str, str] | None = None,
    half: bool = False,
    parts: bool = False,
) -> None:
    """Write arrays as float32 channels of one OpenEXR file (ZIP, lossless), whole or not at all.

    Args:
        path: the file; one that exists is replaced.
        arrays: by name, [rows, columns] or [rows, columns, 3], all of one size, row 0 on top.
            "image" (or "") becomes the channels R, G, B (Y with one channel), "depth" Z, "normal"
            N.X, N.Y, N.Z; any other name stands for itself, with .R, .G, .B if it has 3 channels.
            Infinities and NaN are kept.
        data: (first column, first row, last column, last row) of the arrays' pixels, in pixels;
            by default the first are 0.
        display: likewise of the image; by default the same as `data`.
        like: a file whose windows and other attributes are kept, in place of both.
        camera: of the image, for the header; arrays that are larger have a margin, outside of the display window.
        attributes: further ones, texts by name.
        half: whether channels are half floats, but for depth ("depth", Z), whose rounding of 5e-4 would bend planes.
        parts: whether each array is a part of its own, called by its name ("rgba" for "image"), with the same
            channels: what programs call a multi-part file.

    Raises:
        TypeError: an array is not of real numbers.
        ValueError: no array, a wrong shape, sizes that differ, a window of another size, a channel that is
            there twice, or a value beyond 65504, the largest half float.
        OSError: the file can't be written; the message names it.
    """
    planes, own = _planes(arrays)
    own = own if parts else {}
    rows, columns = next(iter(planes.values())).shape
    channels: dict[str, NDArray[Any]] = {name: _stored(name, plane, half=half) for name, plane in planes.items()}
    if like is not None:
        size = read_headers(Path(like))[0].size
        _check_size("the arrays", next(iter(planes.values())), size, f"the data window of {os.fspath(like)}")
        _save(path, {**_kept(_attributes(os.fspath(like))), **(attributes or {})}, channels, own)
        return
    header: dict[str, Any] = dict(attributes or {})
    if camera is not None:
        header |= camera_attributes(camera)
        across, down = (columns - camera.width) // 2, (rows - camera.height) // 2
        data = data or (-across, -down, columns - across - 1, rows - down - 1)
        display = display or (0, 0, camera.width - 1, camera.height - 1)
    data = (0, 0, columns - 1, rows - 1) if data is None else data
    if (data[3] - data[1] + 1, data[2] - data[0] + 1) != (rows, columns):
        raise ValueError(f"data is {data}: expected a window of {columns} columns and {rows} rows, as the arrays")
    windows = {"dataWindow": _box(data), "displayWindow": _box(display or data)}
    _save(path, {**header, **windows}, channels, own)


def write_in_rows(
    path: str | os.PathLike[str],
    rows: Iterator[tuple[int, Mapping[str, ArrayLike]]],
    *,
    like: str | os.PathLike[str],
    attributes: Mapping[str, str] | None = None,
) -> None:
    """Write a file as `write` does, of bands of rows that come one after the other; whole or not at all.

    Args:
        path, like, attributes: as of `write`.
        rows: the first row and the arrays of each band, from the top; bands but the last are multiples of
            `exr_rows.CHUNK` rows high.

    Raises:
        ValueError, OSError: as `write`; whatever `rows` raises.
    """
    header = {**_kept(_attributes(os.fspath(like))), **(attributes or {})}
    size = read_headers(Path(like))[0].size
    write_rows(path, header, size, ((first, _planes(arrays)[0]) for first, arrays in rows))


def _stored(name: str, plane: NDArray[np.float32], *, half: bool) -> NDArray[Any]:
    """Return a plane in the type that its channel has."""
    if not half or name == "Z":
        return plane
    most = float(np.finfo(np.float16).max)
    with np.errstate(invalid="ignore"):
        if (np.isfinite(plane) & (np.abs(plane) > most)).any():
            raise ValueError(f"channel {name!r} has values beyond {most:g}: expected half=False, or smaller values")
    return plane.astype(np.float16)


def add(path: str | os.PathLike[str], arrays: Mapping[str, ArrayLike]) -> None:
    """Add arrays to an OpenEXR file, in place of channels of the same names.

    The file keeps its windows, its other attributes and the values of its other channels, in their
    own types. It is written anew with ZIP compression, whole or not at all.

    Args:
        path: a file as for `read`.
        arrays: as of `write`, of the size of the file's data window.

    Raises:
        FileNotFoundError, ValueError, OSError: as `read` and `write`.
        TypeError: as `write`.
    """
    new, header_of = _planes(arrays)[0], read_headers(Path(path))
    if len(header_of) > 1:
        raise ValueError(f"{os.fspath(path)} has {len(header_of)} parts: expected a file with one")
    size = header_of[0].size
    for name, plane in new.items():
        _check_size(name, plane, size, "the file's data window")
    header, present = _decoded(os.fspath(path), size)
    _save(path, _kept(header), {**present, **new})


def _attributes(name: str) -> dict[str, Any]:
    """Return the attributes of the first part of a file."""
    try:
        with utf8(name, os.O_RDONLY) as readable:
            attributes: dict[str, Any] = OpenEXR.File(readable, header_only=True).header()
    except (RuntimeError, ValueError) as error:
        raise ValueError(f"{name} is damaged or cut short: its header can't be decoded") from error
    return attributes


def _kept(header: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes of a file that another one of the same image has too."""
    own = {"channels", "compression", "type", "tiles", "lineOrder", "chunkCount", "version", "name", "view"}
    return {name: value for name, value in header.items() if name not in own}


def _save(
    path: str | os.PathLike[str],
    header: dict[str, Any],
    channels: dict[str, Any],
    parts: Mapping[str, Sequence[str]] | None = None,
) -> None:
    """Write a file of scan lines, whole or not at all; `parts` has the names of the channels of each, if any."""
    header = {**header, "compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    several = [
        OpenEXR.Part({**header, "name": name}, {key: channels[key] for key in own}, name)
        for name, own in (parts or {}).items()
    ]
    with atomic.replacement(path) as temporary:
        try:
            with utf8(os.fspath(temporary), os.O_WRONLY) as writable:
                (OpenEXR.File(several) if several else OpenEXR.File(header, channels)).write(writable)
        except RuntimeError as error:
            reason = str(error).replace(os.fspath(temporary), os.fspath(path))
            raise OSError(f"cannot write {os.fspath(path)}: {reason}") from error


def _box(window: Window) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    return np.array(window[:2], np.int32), np.array(window[2:], np.int32)


def _planes(arrays: Mapping[str, ArrayLike]) -> tuple[dict[str, NDArray[np.float32]], dict[str, list[str]]]:
    """Return channel -> [rows, columns], all of one size; and part -> its channels, a part for each array."""
    channels: dict[str, NDArray[np.float32]] = {}
    parts: dict[str, list[str]] = {}
    size: tuple[int, ...] = ()
    for name, value in arrays.items():
        array = checks.floats(name, value)
        if array.ndim not in (2, 3) or array.shape[2:] not in ((), (1,), (3,)) or array.size == 0:
            raise ValueError(f"{name} has shape {array.shape}: expected (rows, columns) or (rows, columns, 3)")
        size = size or array.shape[:2]
        _check_size(name, array, size, "the arrays before it")
        for channel, plane in _split(name, array):
            if channel in channels:
                raise ValueError(f"{name} needs the channel {channel!r}, which is taken already")
            channels[channel] = plane
            parts.setdefault(_PARTS.get(name, name), []).append(channel)
    if not channels:
        raise ValueError("arrays is empty: expected at least one array")
    return channels, parts


def _check_size(name: str, array: NDArray[Any], size: tuple[int, ...], what: str) -> None:
    rows, columns = array.shape[:2]
    if (rows, columns) != size:
        raise ValueError(f"{name} has {rows} rows and {columns} columns: expected {size[0]} x {size[1]} as {what}")


def _split(name: str, array: NDArray[np.float32]) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Yield (channel, contiguous plane); the writer reads any other memory layout wrongly."""
    stem = _STEMS.get(name, name)
    if array.shape[2:] == (3,):
        for index, suffix in enumerate(_SUFFIXES.get(name, ("R", "G", "B"))):
            plane = np.ascontiguousarray(array[..., index])
            yield (f"{stem}.{suffix}" if stem else suffix), plane
    else:
        plane = np.ascontiguousarray(array.reshape(array.shape[:2]))
        yield _SINGLES.get(name, stem) or "Y", plane


def read(path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
    """Return the channels of an OpenEXR file by name.

    Args:
        path: a file of flat pixels (scan lines or tiles) without subsampling. Channels of several parts have
            the name of their part before them, such as "depth.Z"; parts are of one size.

    Returns:
        [rows, columns] of the data window each, row 0 on top: float32 for half and float, uint32
        for integers. See `exr_header.read_headers` for where the image (the display window) lies.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: not an OpenEXR file, damaged, cut short, or of a kind not named above.
        OSError: the file can't be read.
    """
    name = os.fspath(path)
    return _chosen(name, read_headers(Path(name)))


def _chosen(
    name: str, headers: Sequence[ExrHeader], wanted: Set[str] | None = None, rows: tuple[int, int] | None = None
) -> dict[str, NDArray[Any]]:
    """Return channels of a file, as `read`: all, or those wanted; the others may be of any kind. Or `rows` of them."""
    chosen: list[dict[str, str]] = []
    first: ExrHeader | None = None
    for header in headers:
        own = {short: whole for short, whole in header.names.items() if wanted is None or whole in wanted}
        chosen.append(own)
        first = first or (header if own else None)
        if own and first is not None and (header.data, header.display) != (first.data, first.display):
            raise ValueError(
                f"{name}: part {header.name!r} has the data window {header.data}, part {first.name!r} has "
                f"{first.data}: expected one"
            )
        for channel in header.channels:
            if channel.name in own and channel.sampling != (1, 1):
                raise ValueError(
                    f"{name}: channel {channel.name!r} is subsampled {channel.sampling[0]} x "
                    f"{channel.sampling[1]}: expected one value for each pixel"
                )
    if rows is not None:
        return read_rows(name, headers, chosen[0], rows)
    arrays: dict[str, NDArray[Any]] = {}
    for key, pixels in _decoded(name, (first or headers[0]).size, chosen)[1].items():
        kind = np.uint32 if pixels.dtype.kind == "u" else np.float32
        arrays[key] = np.ascontiguousarray(pixels, dtype=kind)
    return arrays


def _decoded(
    name: str, size: tuple[int, int], chosen: Sequence[Mapping[str, str]] | None = None
) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Return the attributes of a file's first part, and channels of the size of the data window.

    Args:
        name: of the file.
        size: (rows, columns) of the data window.
        chosen: for each part the channels to return, and their names in what is returned; by default
            those of the first part.
    """
    try:
        with utf8(name, os.O_RDONLY) as readable:
            file = OpenEXR.File(readable, separate_channels=True)
            header = file.header()
            parts = [part.channels for part in file.parts] if chosen is not None else [file.channels()]
    except MemoryError as error:
        raise ValueError(f"{name}: {size[1]} x {size[0]} pixels need more memory than there is") from error
    except (RuntimeError, ValueError) as error:
        raise ValueError(f"{name} is damaged or cut short: its pixels can't be decoded") from error
    arrays = {}
    for channels, own in zip(parts, chosen or [{key: key for key in parts[0]}], strict=True):
        for key, whole in own.items():
            pixels = channels[key].pixels
            if pixels is None or pixels.shape != size:
                raise ValueError(f"{name} is damaged: channel {key!r} is not {size[0]} x {size[1]}")
            arrays[whole] = pixels
    return header, arrays


def read_gbuffer(
    path: str | os.PathLike[str],
    channels: Mapping[str, str | tuple[str, ...]] | None = None,
    *,
    size: tuple[int, int] | None = None,
    layer: str | None = None,
    part: str | None = None,
    layout: str | None = None,
) -> dict[str, Any]:
    """Return the arrays of a G-buffer that an OpenEXR file holds.

    Args:
        path: a file as for `read`.
        channels: channel names for some of "depth" (one name), "normal", "albedo", "emission"
            (three names each, or the stem of three: "N" for N.X, N.Y, N.Z). What isn't given is
            looked for under its usual names, see `exr_channels`.
        size: (rows, columns) of the camera: that of the display window, which the data window may
            exceed equally on opposite sides (the margin), or that of the data window. By default
            any.
        layer: whose quantities are read; by default the one with a depth that has the most.
        part: of a file of several parts, the one that is read; by default all.
        layout: program whose conventions the file has, one of `exr_layouts.LAYOUTS`; guessed by default.

    Returns:
        "depth" [rows, columns] as it is stored, and "normal", "albedo", "emission" [rows, columns, 3] as far as the
        file has them. Depths of 1e10 and more, Blender's background, are +inf. "notes": what was
        read, and what was not, in words.

    Raises:
        FileNotFoundError, OSError: as `read`.
        ValueError: as `read`; windows that `size` does not allow; no depth, or a given channel
            that the file doesn't have: the message lists those that it has.
    """
    return read_with_kind(path, channels, size=size, layer=layer, part=part, layout=layout)[0]


def read_with_kind(
    path: str | os.PathLike[str],
    channels: Mapping[str, str | tuple[str, ...]] | None = None,
    *,
    size: tuple[int, int] | None = None,
    layer: str | None = None,
    part: str | None = None,
    layout: str | None = None,
    rows: tuple[int, int] | None = None,
) -> tuple[dict[str, Any], str]:
    """Return what `read_gbuffer` does, and the kind of depth that the layout expects.

    That is one of `core.depth_kind.KINDS`, or "" where it has to be said. With `rows`, the first and the one
    behind the last, these rows of the data window alone are read.
    """
    name = os.fspath(path)
    headers = read_headers(Path(name))
    if size is not None:
        _check_regions(name, headers[0], size)
    wanted = dict(channels or {})
    unknown = sorted(set(wanted) - QUANTITIES.keys())
    if unknown:
        raise ValueError(f"channels names {unknown[0]!r}: expected 'depth', 'normal', 'albedo' or 'emission'")
    chosen = [each for each in headers if part is None or each.name == part]
    if not chosen:
        parts = ", ".join(repr(each.name) for each in headers)
        raise ValueError(f"{name} has no part {part!r}; it has {parts}")
    names = [whole for header in chosen for whole in header.names.values()]
    given = {key: _given(name, key, value, names) for key, value in wanted.items()}
    program, note = layout_of(layout, names, _attributes(name))
    first = {} if program is None else {"depth": tuple(program.depths), "normal": program.normals}
    try:
        found = found_channels(names, layer, given, first)
    except ValueError as error:
        raise type(error)(f"{name}: {error}") from None
    present = _chosen(name, headers, {channel for each in found.channels.values() for channel in each}, rows)
    arrays: dict[str, Any] = {"notes": (*filter(None, [note]), *found.notes)}
    for key, own in found.channels.items():
        planes = [present[channel].astype(np.float32, copy=False) for channel in own]
        arrays[key] = planes[0] if key == "depth" else np.stack(planes, axis=-1)
    depth = arrays["depth"].copy()
    depth[depth >= BACKGROUND_DEPTH] = np.inf
    arrays["depth"] = depth
    kinds = {} if program is None else program.depths
    return arrays, kinds.get(stem_of(found.channels["depth"][0]), "planar")


def read_motion(
    path: str | os.PathLike[str],
    channels: str | Sequence[str] | None = None,
    *,
    kind: str | None = None,
    layer: str | None = None,
    part: str | None = None,
) -> tuple[NDArray[np.float32], tuple[str, ...]]:
    """Return motion [rows, columns, 2 or 3] as a file has it, and the channels that it is read from.

    Args:
        path: a file as for `read`.
        channels: the two or three channels, or their stem; found by their usual names if not given.
        kind: the convention whose names are looked for, one of `core.motion.MOTION_KINDS`; by default all.
        layer, part: as of `read_gbuffer`.

    Raises:
        FileNotFoundError, OSError: as `read`.
        ValueError: as `read`, or there is no motion; the message lists the channels.
    """
    name = os.fspath(path)
    headers = read_headers(Path(name))
    names = [whole for each in headers if part is None or each.name == part for whole in each.names.values()]
    try:
        found = motion_channels(names, kind, layer, channels)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    present = _chosen(name, headers, set(found))
    return np.stack([present[channel].astype(np.float32, copy=False) for channel in found], axis=-1), found


def read_camera(path: str | os.PathLike[str]) -> HeaderCamera:
    """Return the camera that a file's header describes, for `read_gbuffer`, and a note.

    It is that of the display window where the data window is that or exceeds it equally on opposite sides,
    else that of the data window.

    Raises:
        FileNotFoundError, ValueError, OSError: as `read`.
    """
    name = os.fspath(path)
    header = read_headers(Path(name))[0]
    camera, note, axes = header_camera(_attributes(name), header)
    if camera is not None and not _is_margin(header):
        left, top = header.data[0] - header.display[0], header.data[1] - header.display[1]
        rows, columns = header.size
        camera = camera.cropped(left, top, columns, rows)
    return HeaderCamera(camera, note, axes)


def _is_margin(header: ExrHeader) -> bool:
    """Return whether the data window exceeds the display window equally on opposite sides, or is the same."""
    data, display = (np.reshape(window, (2, 2)) for window in (header.data, header.display))
    before, after = display[0] - data[0], data[1] - display[1]
    return bool((before == after).all() and (before >= 0).all())


def _check_regions(name: str, header: ExrHeader, size: tuple[int, int]) -> None:
    """Raise ValueError unless the windows of a file are those of a camera of this size."""
    data, display = (np.reshape(window, (2, 2)) for window in (header.data, header.display))
    if size != header.size and not _is_margin(header):
        raise ValueError(
            f"{name} has the data window {data.tolist()} and the display window "
            f"{display.tolist()}: expected the same window, or a margin of equal size on "
            "opposite sides, or camera.cropped(...) to the data window"
        )


def _given(path: str, key: str, wanted: str | tuple[str, ...], present: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the channels that a caller gave for a quantity."""
    if isinstance(wanted, str) and key != "depth":
        triples = (tuple(f"{wanted}.{c}" for c in components) for components in ("XYZ", "RGB", "xyz"))
        found = next((triple for triple in triples if all(name in present for name in triple)), None)
        names: tuple[str, ...] = found or (f"{wanted}.*",)
    else:
        names = (wanted,) if isinstance(wanted, str) else tuple(wanted)
        count = 1 if key == "depth" else 3
        if len(names) != count:
            raise ValueError(f"channels[{key!r}] is {wanted!r}: expected {count} channel name(s)")
    for name in names:
        if name not in present:
            raise ValueError(f"{path} has no channel {name!r}; it has {', '.join(sorted(present)) or 'none'}")
    return names
