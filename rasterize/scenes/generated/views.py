"""Views of a generated scene: outside of all that is closed, and looking at something."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.camera import Camera

from ...parts import Part
from ..builtin import Vector
from ..scatter import Doubles

PROBE = (6, 8)
"""Rows and columns of the rays that tell what a view shows."""

_PARALLEL = 1e-12


class Candidate(NamedTuple):
    """Eye and target of a possible camera, world space, metres."""

    eye: Vector
    target: Vector


class Surroundings:
    """Triangles round possible eyes.

    Args:
        parts: (part, whether it is closed).
    """

    def __init__(self, parts: Iterable[tuple[Part, bool]]) -> None:
        corners, closed = [], []
        for part, is_closed in parts:
            corners.append(part.positions[part.triangles])
            closed.append(np.full(len(part.triangles), is_closed))
        self.corners = np.concatenate(corners)
        self.closed: NDArray[np.bool_] = np.concatenate(closed)
        self._middle = self.corners.mean(axis=1)
        self._reach = np.linalg.norm(self.corners - self._middle[:, None], axis=2).max(axis=1)

    def winding(self, eye: Vector) -> float:
        """Return how many closed surfaces lie round a point (van Oosterom and Strackee 1983)."""
        a, b, c = np.moveaxis(self.corners[self.closed] - np.asarray(eye), 1, 0)
        la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
        over = np.einsum("ij,ij->i", a, np.cross(b, c))
        under = la * lb * lc + lc * np.einsum("ij,ij->i", a, b)
        under += la * np.einsum("ij,ij->i", b, c) + lb * np.einsum("ij,ij->i", c, a)
        return float(np.arctan2(over, under).sum() / (2.0 * np.pi))

    def is_free(self, eye: Vector, clearance: float) -> bool:
        """Return whether a point is outside all that is closed, and nothing is within a distance."""
        near = np.linalg.norm(self._middle - np.asarray(eye), axis=1) - self._reach < clearance
        if near.any() and _distance(self.corners[near] - np.asarray(eye)).min() < clearance:
            return False
        return abs(self.winding(eye)) < 0.5

    def distances(self, camera: Camera) -> Doubles:
        """Return [camera's rows, columns] the distance that each pixel's centre sees; inf: none."""
        rows, columns = camera.size
        ways = camera.unproject(np.ones((rows, columns), np.float32)) - camera.position
        ways = (ways / np.linalg.norm(ways, axis=-1, keepdims=True)).reshape(-1, 3)
        ways = ways.astype(np.float32)
        # Balls round triangles, against the cone that holds all rays.
        middle = self._middle - camera.position
        axial = -(middle @ camera.view[2, :3])
        cosine = float((ways @ -camera.view[2, :3]).min())
        sine = float(np.sqrt(1.0 - cosine**2))
        across = np.sqrt(np.maximum(np.einsum("ij,ij->i", middle, middle) - axial**2, 0.0))
        ahead = cosine * across - sine * axial <= self._reach
        a, b, c = np.moveaxis((self.corners[ahead] - camera.position).astype(np.float32), 1, 0)
        edges = [np.cross(p, q) for p, q in ((a, b), (b, c), (c, a))]
        sides = [ways @ edge.T for edge in edges]
        inside = np.logical_and.reduce([s >= 0 for s in sides])
        inside |= np.logical_and.reduce([s <= 0 for s in sides])
        ray, triangle = np.nonzero(inside)
        under = sum(side[ray, triangle] for side in sides)
        over = np.einsum("ij,ij->i", a, edges[1])[triangle]
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(np.abs(under) > _PARALLEL, over / under, np.inf)
        result = np.full(len(ways), np.inf)
        np.minimum.at(result, ray, np.where(t > 0.0, t, np.inf))
        return result.reshape(rows, columns)


def chosen(
    surroundings: Surroundings,
    candidates: Iterable[Candidate],
    count: int,
    *,
    yfov: float,
    clearance: float,
    coverage: float,
) -> list[Candidate]:
    """Return the first `count` candidates that show enough; the best of the others fill up.

    Args:
        surroundings: what there is.
        candidates: tried in this order.
        count: of views.
        yfov: vertical field of view, radians.
        clearance: least distance from the eye to any surface, metres.
        coverage: least share of the picture in which a surface is seen, in [0, 1].

    Raises:
        RuntimeError: fewer than `count` candidates are outside all that is closed.
    """
    good: list[Candidate] = []
    others: list[tuple[float, Candidate]] = []
    for candidate in candidates:
        if not surroundings.is_free(candidate.eye, clearance):
            continue
        camera = Camera.look_at(candidate.eye, candidate.target, yfov=yfov, width=PROBE[1], height=PROBE[0])
        seen = surroundings.distances(camera)
        hit = np.isfinite(seen)
        blocked = float((seen < 3.0 * clearance).mean())
        middle = float(np.median(seen[hit])) if hit.any() else 0.0
        if hit.mean() >= coverage and blocked <= 0.12 and middle >= 5.0 * clearance:
            good.append(candidate)
        else:
            others.append((float(hit.mean()) - blocked, candidate))
        if len(good) == count:
            return good
    others.sort(key=lambda pair: -pair[0])
    good += [candidate for _, candidate in others[: count - len(good)]]
    if len(good) < count:
        raise RuntimeError(f"{len(good)} of {count} views are free: expected more candidates")
    return good


def _distance(corners: Doubles) -> Doubles:
    """Return [triangles] the distance from the origin to each of `corners` [triangles, 3, 3]."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), _PARALLEL)
    normal = normal / length
    height = np.einsum("ij,ij->i", normal, corners[:, 0])
    foot = normal * height[:, None]
    after = np.roll(corners, -1, axis=1)
    edge = after - corners
    side = np.einsum(
        "tij,tij->ti", np.cross(edge, foot[:, None] - corners), np.broadcast_to(normal[:, None], edge.shape)
    )
    within = (side >= 0).all(axis=1)
    squared = np.maximum(np.einsum("tij,tij->ti", edge, edge), _PARALLEL)
    share = np.clip(-np.einsum("tij,tij->ti", corners, edge) / squared, 0.0, 1.0)
    nearest = np.linalg.norm(corners + share[..., None] * edge, axis=2).min(axis=1)
    distance: Doubles = np.where(within, np.abs(height), nearest)
    return distance
