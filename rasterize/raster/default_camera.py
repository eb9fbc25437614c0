"""A camera and lights for a scene that brings none."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.raster.extent import Extent
from ssgi_cl.rasterize.raster.shadow_map import light_cameras
from ssgi_cl.rasterize.raster.view import gbuffer

Vector = NDArray[np.float64]

SUN_IRRADIANCE = (9.0, 8.4, 7.5)
"""W/m^2; of the order of the sky's pi W/m^2, so that shadows are neither black nor faint."""

LIGHT_IRRADIANCE = (8.0, 7.5, 6.8)
"""W/m^2 that the light of a room sends to what is as far from it as half of what it sees."""

ZENITH, HORIZON, GROUND = (0.75, 0.95, 1.25), (1.0, 1.05, 1.1), (0.45, 0.42, 0.38)
"""Radiance of the sky and of the ground below it, W m^-2 sr^-1."""

DEFAULT_YFOV = math.radians(50.0)
"""Vertical field of view in radians."""

_ENCLOSED = 0.6
"""Share of all directions in which a room's inner sides are seen, at least. A cube without a lid
has 5/6, the centre of a closed object 0 (it sees the back of its surface), a yard about 0.4."""

_ROOM = 8.0
"""Times that a closed scene may be larger than its subject to be taken for a room: beyond, it is a
dome round an object."""

_LONG = 5.0
"""Times that a long scene's longer horizontal side is longer than its other sides, at least."""

_PROBE_SIZE = 32  # rows and columns of each of the six faces of a look round
_CENTRE = slice(_PROBE_SIZE // 2 - 2, _PROBE_SIZE // 2 + 2)
_UP, _DOWN = 2, 3  # faces
_HORIZONTAL = {0: (1.0, 0.0, 0.0), 1: (-1.0, 0.0, 0.0), 4: (0.0, 0.0, 1.0), 5: (0.0, 0.0, -1.0)}


@dataclass(frozen=True, eq=False)
class _Look:
    """The view all round a point: faces +x, -x, +y, -y, +z, -z of a cube round it, or some of them.

    Attributes:
        eye: [3], world space.
        ways: [faces, rows, columns, 3] unit vectors, world space.
        distance: [faces, rows, columns] scene units; inf where nothing is.
        front: [faces, rows, columns] whether the front of a surface is seen.
        detail: [faces, rows, columns] in [0, 1], how much each pixel differs from its neighbours.
    """

    eye: Vector
    ways: Vector
    distance: Vector
    front: NDArray[np.bool_]
    detail: Vector

    @property
    def is_enclosed(self) -> bool:
        return bool(self.front.mean() >= _ENCLOSED)

    def is_enclosed_by(self, extent: Extent) -> bool:
        """Whether it is enclosed by what lies in a box, not by a dome round it."""
        near = self.front & (self.distance <= extent.diagonal)
        return bool(near.mean() >= _ENCLOSED)

    def clearance(self, way: Vector, angle: float) -> float:
        """Distance to the nearest thing within `angle` (radians) of the unit vector `way`."""
        within = self.ways @ way > math.cos(angle)
        return float(self.distance[within].min())


def _look(
    scene: Scene, extent: Extent, eye: Vector, runtime: Runtime, faces: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
) -> _Look:
    cameras = light_cameras(PointLight(eye, 1.0), extent.bounds, _PROBE_SIZE)
    ways, distances, fronts, details = [], [], [], []
    for camera in (cameras[face] for face in faces):
        seen = gbuffer(scene, camera, runtime=runtime)
        depth, normal = _drawn(seen, "depth"), _drawn(seen, "normal")
        turn = np.eye(4)
        turn[:3, :3] = camera.view[:3, :3]
        # The camera's axes without its position keep the directions exact far from the origin.
        unit = Camera(view=turn, projection=camera.projection, width=camera.width, height=camera.height)
        way = unit.unproject(np.ones_like(depth))
        length = np.linalg.norm(way, axis=-1)
        way /= length[..., None]
        ways.append(way)
        distances.append(depth * length)
        fronts.append(np.isfinite(depth) & (np.einsum("rcd,rcd->rc", way, normal) < 0.0))
        details.append(_detail(seen))
    return _Look(eye, *map(np.stack, (ways, distances, fronts, details)))


def _drawn(seen: GBuffer, name: str) -> NDArray[np.float32]:
    array = seen.first(name)
    assert array is not None  # noqa: S101  the rasteriser writes it
    return array


def _detail(seen: GBuffer) -> Vector:
    """Return [rows, columns] in [0, 1]: how much normals and albedo change at each pixel."""
    features = np.concatenate([_drawn(seen, "normal"), _drawn(seen, "albedo")], axis=-1)
    change = np.zeros(features.shape[:2])
    change[:, 1:] += np.abs(np.diff(features, axis=1)).sum(axis=-1)
    change[1:] += np.abs(np.diff(features, axis=0)).sum(axis=-1)
    return np.minimum(change, 1.0)


@checked_keywords
def default_camera(
    scene: Scene, width: int = 800, height: int = 600, yfov: float = DEFAULT_YFOV, runtime: Runtime | None = None
) -> Camera:
    """Return a camera that sees a scene well.

    A room, whose surfaces face its middle, is seen from within; one that lacks a wall, through
    the gap; one that lacks the ceiling, from above; anything else from outside, so that it fills
    the picture: of a scene with a large ground or backdrop, what stands before it. What is long
    is seen from one of its ends.

    Args:
        scene: y is up.
        width, height: pixels.
        yfov: vertical field of view in radians; 50 degrees by default.
        runtime: the device that looks round; by default the fastest found.
    """
    runtime = runtime or Runtime.open()
    extent, subject = Extent.of(scene), Extent.of_subject(scene)
    middle = None
    if extent.diagonal < _ROOM * subject.diagonal:
        middle = _middle_of_room(scene, extent, runtime)
    if middle is None and subject.diagonal < extent.diagonal:
        extent = subject
        middle = _middle_of_room(scene, extent, runtime)
    if middle is None:
        way = _best_side(scene, subject, width, height, yfov, runtime)
        return _from_outside(subject, way, width, height, yfov)
    gap = _gap(middle, extent)
    if gap == _UP:
        return _from_outside(extent, np.array([0.45, 1.2, 1.0]), width, height, yfov)
    if gap is not None:
        return _from_outside(extent, np.array(_HORIZONTAL[gap]), width, height, yfov)
    return _from_within(scene, extent, width, height, yfov, runtime)


def _middle_of_room(scene: Scene, extent: Extent, runtime: Runtime) -> _Look | None:
    """Return what is seen from the middle of a room, None if the box of `extent` is no room."""
    for height in (0.5, 0.35):  # the higher one may be amid a piece of furniture
        middle = _look(scene, extent, extent.at(0.5, height, 0.5), runtime)
        # What is long and open straight above is a street, or the gap between two houses.
        zenith = middle.distance[_UP][_CENTRE, _CENTRE]
        is_street = _length_of(extent) is not None and not np.isfinite(zenith).all()
        if middle.is_enclosed_by(extent) and not is_street:
            return middle
    return None


def _length_of(extent: Extent) -> int | None:
    """Return the axis, 0 or 2, along which a scene is long; None if it is not."""
    x, y, z = extent.size
    if max(x, z) < _LONG * max(y, min(x, z)):
        return None
    return 2 if z >= x else 0


def _best_side(scene: Scene, extent: Extent, width: int, height: int, yfov: float, runtime: Runtime) -> Vector:
    """Return the direction, among eight from somewhat above, from which most detail is seen.

    The first, towards +z, is the front by glTF's convention and has an advantage. What is long is
    looked at from beyond its ends, along it, turned so little that its far end is in the picture
    however long it is.
    """
    thinned = extent.thinned(20_000)
    best, best_score = np.array([0.45, 0.35, 1.0]), -math.inf
    along = _length_of(extent)
    angles, rise = [0.42 + turn * math.pi / 4.0 for turn in range(8)], 0.32
    columns, rows, field = 64, 64, 0.6
    if along is not None:
        half = math.atan(math.tan(0.5 * yfov) * width / height)
        turns = [end + share * half for share in (0.9, -0.9, 0.7, -0.7) for end in (0.0, math.pi)]
        angles = [turn + (0.5 * math.pi if along == 0 else 0.0) for turn in turns]
        rise = math.tan(0.8 * 0.5 * yfov)
        columns, rows, field = _thumbnail(width, height), _thumbnail(height, width), yfov
    for turn, angle in enumerate(angles):
        way = np.array([math.sin(angle), rise, math.cos(angle)])
        camera = _from_outside(thinned, way, columns, rows, field)
        seen = gbuffer(scene, camera, runtime=runtime)
        back = np.isfinite(_drawn(seen, "depth")) & (_drawn(seen, "normal") @ way < -0.2)
        score = float(_detail(seen).mean()) - 2.0 * float(back.mean())
        if along is None:
            # Detail in scene units: a narrow view of a deep object fills the picture too.
            score *= float(np.linalg.norm(camera.position - extent.at(0.5, 0.5, 0.5))) ** 2
        if turn == 0 and score > 0.0:
            score *= 1.2
        if score > best_score:
            best, best_score = way, score
    return best


def _thumbnail(side: int, other: int) -> int:
    """Return a side of a small picture of the same proportions."""
    return max(round(96 * side / max(side, other)), 1)


def _gap(look: _Look, extent: Extent) -> int | None:
    """Return the face where a room is open: a wall or the ceiling; None if it is closed."""
    # Which side of the scene's box each ray leaves through.
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = np.where(look.ways > 0.0, extent.bounds[1], extent.bounds[0]) - look.eye
        steps = np.where(look.ways == 0.0, math.inf, ahead / look.ways)
    axis = steps.argmin(axis=-1)
    onward = np.take_along_axis(look.ways, axis[..., None], axis=-1)[..., 0] > 0.0
    side = 2 * axis + ~onward
    met = look.distance <= steps.min(axis=-1) + 0.01 * extent.diagonal  # not a ground further out
    covered = {}
    for face in (*_HORIZONTAL, _UP):
        through = met[side == face]
        covered[face] = float(through.mean()) if through.size else 1.0
    face = min(covered, key=covered.__getitem__)
    others = [share for other, share in covered.items() if other != face]
    return face if covered[face] < 0.3 and min(others) > 0.7 else None


def _from_outside(extent: Extent, way: Vector, width: int, height: int, yfov: float) -> Camera:
    """Return the nearest camera in direction `way` of the scene that sees all of it."""
    back = way / np.linalg.norm(way)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right), back])
    across, upward, toward = axes.astype(np.float32) @ extent.points.T
    filled = 0.9  # of the picture's width or height
    slope_y = filled * math.tan(0.5 * yfov)
    slope_x = slope_y * width / height
    # |across - x| <= slope (z - toward) for every point: four planes, each with its furthest point.
    x, z_x = _wedge(across, toward, slope_x)
    y, z_y = _wedge(upward, toward, slope_y)
    z = max(z_x, z_y)
    middle = float(0.5 * (toward.min() + toward.max()))
    eye, target = extent.origin + axes.T @ (x, y, z), extent.origin + axes.T @ (x, y, middle)
    least = 1e-3 * extent.diagonal
    if z - middle < least:  # a single point
        eye = target + back * extent.diagonal
    near = 0.1 * max(z - float(toward.max()), 1e-2 * extent.diagonal)
    return Camera.look_at(eye, target, yfov=yfov, width=width, height=height, near=near)


def _wedge(across: NDArray[np.float32], toward: NDArray[np.float32], slope: float) -> tuple[float, float]:
    """Return where the edge of the tightest wedge of that slope lies: (across, toward)."""
    right = float((across + np.float32(slope) * toward).max())
    left = float((np.float32(slope) * toward - across).max())
    return 0.5 * (right - left), 0.5 * (right + left) / slope


def _from_within(scene: Scene, extent: Extent, width: int, height: int, yfov: float, runtime: Runtime) -> Camera:
    """Return the camera that sees furthest and most, of some places and directions in a room."""
    xfov = 2.0 * math.atan(math.tan(0.5 * yfov) * width / height)
    shares = (0.28, 0.5, 0.72)
    places = [extent.at(x, 0.37, z) for x in shares for z in shares]
    looks = [_look(scene, extent, place, runtime, (*_HORIZONTAL,)) for place in places]
    best, best_score, best_way = looks[4], -math.inf, np.array([1.0, 0.0, 0.0])
    for look in looks:
        if not look.is_enclosed:  # in a wall, in a cupboard, or out of doors
            continue
        for angle in np.arange(16) * (math.pi / 8.0):
            way = np.array([math.cos(angle), 0.0, math.sin(angle)])
            score = _view_score(look, way, xfov, yfov, extent.diagonal)
            if score > best_score:
                best, best_score, best_way = look, score, way
    # Back towards the wall behind, but not into what stands there.
    step = 0.6 * min(best.clearance(-best_way, math.radians(25.0)), 0.5 * extent.diagonal)
    eye = best.eye - best_way * step
    target = eye + best_way * extent.diagonal - [0.0, 0.06 * extent.diagonal, 0.0]
    return Camera.look_at(eye, target, yfov=yfov, width=width, height=height, near=1e-4 * extent.diagonal)


def _view_score(look: _Look, way: Vector, xfov: float, yfov: float, diagonal: float) -> float:
    """Return how far and how much one sees along the horizontal `way`.

    The weights were chosen by eye, on three interiors.
    """
    along = look.ways @ way
    side = look.ways @ np.array([-way[2], 0.0, way[0]])
    inside = (
        (along > 0.0)
        & (np.abs(side) < along * math.tan(0.5 * xfov))
        & (np.abs(look.ways[..., 1]) < along * math.tan(0.5 * yfov))
    )
    if not inside.any():
        return -math.inf
    distance = np.clip(look.distance[inside], 1e-3 * diagonal, diagonal)
    close = float((distance < 0.08 * diagonal).mean())
    back = float((~look.front[inside]).mean())
    detail = float(look.detail[inside].mean())
    return float(np.log(distance / diagonal).mean()) + 6.0 * detail - 5.0 * close - back


@checked_keywords
def default_lights(
    scene: Scene, camera: Camera, runtime: Runtime | None = None, *, emission: bool = True
) -> tuple[Light, ...]:
    """Return lights that suit a view: sun and sky, or a light and less sky in a closed room.

    Args:
        scene: y is up.
        camera: the view; the sun stands behind its left shoulder.
        runtime: the device that looks round; by default the fastest found.
        emission: whether surfaces that emit light the scene: then a closed room that has some gets
            no lights besides.
    """
    runtime = runtime or Runtime.open()
    extent = Extent.of(scene)
    lit = emission and any(max(m.emission) > 0.0 for m in scene.materials)
    forward, eye = -camera.view[2, :3], camera.position
    across = np.array([forward[0], 0.0, forward[2]])
    length = float(np.linalg.norm(across))
    level = across / length if length > 1e-6 else None
    place: Vector | None = None
    if ((eye < extent.bounds[0]) | (eye > extent.bounds[1])).any():
        look = _look(scene, extent, extent.at(0.5, 0.5, 0.5), runtime)
        gap = _gap(look, extent) if look.is_enclosed else None
        if gap in _HORIZONTAL and -forward @ _HORIZONTAL[gap] > 0.5:
            place = look.eye + 0.3 * extent.size * _HORIZONTAL[gap]
    else:
        look = _look(scene, extent, eye, runtime)
        if look.is_enclosed and float(np.isfinite(look.distance[_UP]).mean()) > 0.95:
            # Ahead of the eye, at its height.
            place = look.eye if level is None else look.eye + level * 0.5 * look.clearance(level, math.radians(10.0))
    if place is not None:
        return () if lit else (_punctual_light(_look(scene, extent, place, runtime)), _sky(0.6))
    level = np.array([0.0, 0.0, -1.0]) if level is None else level
    right = np.array([-level[2], 0.0, level[0]])
    sun = 0.65 * level + 0.55 * right - [0.0, 1.1, 0.0]
    return (DirectionalLight(sun, SUN_IRRADIANCE), _sky(1.0))


def _punctual_light(look: _Look) -> PointLight:
    """Return a light above the eye of `look`, as bright as the room needs."""
    up = np.array([0.0, 1.0, 0.0])
    rise = 0.45 * look.clearance(up, math.radians(15.0))
    seen = look.distance[np.isfinite(look.distance)]
    reach = float(np.median(seen)) if seen.size else 1.0
    rise = min(rise, reach) if math.isfinite(rise) else 0.0
    return PointLight(look.eye + up * rise, np.asarray(LIGHT_IRRADIANCE) * reach**2)


def _sky(strength: float) -> Environment:
    """Return a sky that is deeper overhead than at the horizon, above a darker ground."""
    rows = 128
    height = np.cos((np.arange(rows) + 0.5) / rows * math.pi)[:, None]
    colors = [np.interp(height, (-0.5, 0.0, 1.0), levels) for levels in zip(GROUND, HORIZON, ZENITH, strict=True)]
    return Environment(strength * np.repeat(np.stack(colors, axis=-1), 2, axis=1))


def camera_from_json(path: Path, width: int | None, height: int | None) -> Camera:
    """Read a camera from a JSON file.

    The file holds an object with `origin`, `forward`, `up` (three numbers each, world space) and
    `fov_deg` (horizontal field of view in degrees); `width` and `height` in pixels where the
    arguments are None.

    Raises:
        ValueError: the file is missing, not JSON, or lacks a field; the message says which.
    """
    return _camera_of(f"the camera file {path}", _json_of(path), width, height)


def cameras_from_json(path: Path, width: int | None, height: int | None) -> list[Camera]:
    """Read cameras from a JSON file: a list of what `camera_from_json` reads, or an object with it as `cameras`.

    Raises:
        ValueError: the file is missing, not JSON, or holds no such list, or an entry is wrong; the message says
            which, counted from 1.
    """
    fields = _json_of(path)
    entries = fields.get("cameras") if isinstance(fields, dict) else fields
    if not isinstance(entries, list) or not entries:
        raise ValueError(f"the camera file {path} holds no list of cameras: expected [...] or {{'cameras': [...]}}")
    cameras = []
    for number, entry in enumerate(entries, 1):
        where = f"camera {number} of {path}"
        try:
            cameras.append(_camera_of(where, entry, width, height))
        except (TypeError, ValueError) as error:
            text = str(error)
            raise ValueError(text if text.startswith(where) else f"{where}: {text}") from error
    return cameras


def _json_of(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ValueError(f"the camera file {path} cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise ValueError(f"the camera file {path} is not JSON: {error}") from error


def _camera_of(where: str, fields: Any, width: int | None, height: int | None) -> Camera:
    """Return the camera of an object in JSON; `where` is what messages call it."""
    fields = fields.get("camera", fields) if isinstance(fields, dict) else {}
    fields = fields if isinstance(fields, dict) else {}
    needed = ("origin", "forward", "up", "fov_deg")
    missing = [name for name in needed if name not in fields]
    if missing:
        raise ValueError(f"{where} lacks {', '.join(missing)}")
    sizes = []
    for name, given, default in (("width", width, 800), ("height", height, 600)):
        wanted = fields.get(name, default) if given is None else given
        sizes.append(checks.integer(name, wanted, low=1, high=16384, unit="px"))
    width, height = sizes
    xfov = math.radians(checks.number("fov_deg", fields["fov_deg"], low=0.1, high=179.0, unit="degrees"))
    yfov = 2.0 * math.atan(math.tan(0.5 * xfov) * height / width)
    origin = checks.vector("origin", fields["origin"], 3)
    forward = checks.direction("forward", fields["forward"])
    return Camera.look_at(origin, origin + forward, fields["up"], yfov=yfov, width=width, height=height, near=1e-3)
