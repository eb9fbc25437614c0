"""Integrals of HBAO, GTAO and the bitmask over a half-plane, and the share that surfaces hide."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.reference.gbuffer import Doubles
from ssgi_cl.techniques.ao.bitmask import BitmaskParams
from ssgi_cl.techniques.ao.gtao import GtaoParams
from ssgi_cl.techniques.ao.hbao import HbaoParams
from ssgi_cl.techniques.ao.slices import SliceParams


@dataclass(frozen=True, eq=False)
class Plane:
    """One side of a plane through the view ray; arrays [pixels].

    Attributes:
        edge: cotangent of the angle between the view ray and the tangent plane.
        facing: cosine between that plane's normal and the view ray.
        n_dot_v: cosine between the surface's normal, which may be another, and the view ray.
        lean: component of the normal across the view ray, along this side.
    """

    edge: Doubles
    facing: Doubles
    n_dot_v: Doubles
    lean: Doubles

    @property
    def length(self) -> Doubles:
        """Of the normal's projection into the plane."""
        result: Doubles = np.hypot(self.n_dot_v, self.lean)
        return result

    @property
    def turn(self) -> Doubles:
        """Angle from the view ray to the projected normal, > 0 towards this side."""
        result: Doubles = np.arctan2(self.lean, self.n_dot_v)
        return result

    @property
    def end(self) -> Doubles:
        """Angle from the view ray to the nearer of the tangent plane and the end of the normal's hemisphere."""
        result: Doubles = np.minimum(np.arctan2(1.0, self.edge), self.turn + 0.5 * np.pi)
        return result

    def seen(self, angle: Doubles) -> Doubles:
        """Return the integral of cos(t - turn) sin(t) from the view ray to an angle."""
        turn = self.turn.reshape((-1,) + (1,) * (angle.ndim - 1))
        result: Doubles = 0.25 * (np.cos(turn) + 2.0 * angle * np.sin(turn) - np.cos(2.0 * angle - turn))
        return result


@dataclass(frozen=True, eq=False)
class Crossed:
    """Surfaces that one side of a plane crosses; arrays [pixels, surfaces], from near to far on the screen.

    Attributes:
        counts: whether a surface is there, within the reach and above the tangent plane.
        cot: cotangent of its angle from the view ray.
        back: the same of its back.
        distance: from the receiver, over the reach.
        depth: behind the receiver, over the reach.
    """

    counts: NDArray[np.bool_]
    cot: Doubles
    back: Doubles
    distance: Doubles
    depth: Doubles

    @classmethod
    def merged(cls, layers: Sequence[Self]) -> Self:
        """Return what several layers hold, pixel by pixel from the first layer to the last."""
        return cls(
            **{
                name: np.stack([getattr(layer, name) for layer in layers], axis=-1).reshape(len(layers[0].cot), -1)
                for name in cls.__dataclass_fields__
            }
        )


def check_technique(params: object) -> None:
    """Raise TypeError or ValueError unless these are parameters of a model that is known here."""
    if not isinstance(params, (GtaoParams, HbaoParams, BitmaskParams)):
        raise TypeError(f"params is {type(params).__name__}: expected those of hbao, gtao or bitmask_ao")
    if getattr(params, "joined", False):
        raise ValueError("joined is True: expected False, surfaces that each have a thickness")
    if getattr(params, "horizon_decay", 0.0) > 0.0:
        raise ValueError("horizon_decay is above 0: expected 0, as it counts by tap and has no limit with more of them")


def hidden_and_whole(params: SliceParams, plane: Plane, crossed: Crossed) -> tuple[Doubles, Doubles]:
    """Return [pixels] what is hidden on a side of a plane, and what there is to hide.

    Raises:
        TypeError: parameters of no technique of slices.
    """
    check_technique(params)
    if isinstance(params, GtaoParams):
        return _gtao(params, plane, crossed)
    if isinstance(params, HbaoParams):
        return _hbao(params, plane, crossed)
    assert isinstance(params, BitmaskParams)  # noqa: S101  it was checked
    return _bitmask(params, plane, crossed)


def _gtao(params: GtaoParams, plane: Plane, crossed: Crossed) -> tuple[Doubles, Doubles]:
    """The highest horizon, cosine-weighted (Jimenez et al. 2016, equation 7)."""
    edge = plane.end
    least = np.cos(np.arctan2(1.0, plane.edge))[:, None]
    top = crossed.cot / np.hypot(1.0, crossed.cot)
    if params.falloff > 0.0:
        thin = (1.0 + params.thin_occluder) ** 2 - 1.0
        distance = np.sqrt(crossed.distance**2 + thin * crossed.depth**2)
        top = least + np.clip((1.0 - distance) / params.falloff, 0.0, 1.0) * (top - least)
    top = np.maximum(np.where(crossed.counts, top, -1.0).max(axis=1), np.cos(edge))
    open_ = plane.seen(edge)
    left = plane.seen(np.arccos(np.clip(top, -1.0, 1.0)))
    return plane.length * (open_ - left), plane.length * open_


def _hbao(params: HbaoParams, plane: Plane, crossed: Crossed) -> tuple[Doubles, Doubles]:
    """Steps that raise the horizon, attenuated by their distance (Bavoil and Sainz 2008)."""
    floor = np.sin(np.minimum(0.5 * np.pi - plane.end + params.angle_bias, 0.5 * np.pi))[:, None]
    elevation = np.where(crossed.counts, crossed.cot / np.hypot(1.0, crossed.cot), -1.0)
    horizon = np.maximum.accumulate(np.maximum(elevation, floor), axis=1)
    gain = np.diff(horizon, axis=1, prepend=floor)
    hidden = np.sum((1.0 - params.attenuation * crossed.distance**2) * gain, axis=1)
    return hidden, 1.0 - floor[:, 0]


def _bitmask(params: BitmaskParams, plane: Plane, crossed: Crossed) -> tuple[Doubles, Doubles]:
    """The union of what surfaces cover, each from its front to its back (Therrien et al. 2023)."""
    edge = plane.end
    front, back = (np.minimum(np.arctan2(1.0, cot), edge[:, None]) for cot in (crossed.cot, crossed.back))
    if params.sectors == "cosine":
        weight, whole = plane.length, plane.seen(edge)
        front, back = plane.seen(front), plane.seen(back)
    else:
        weight, whole = np.ones_like(edge), edge
    front = np.where(crossed.counts, front, np.inf)
    order = np.argsort(front, axis=1)
    front = np.take_along_axis(front, order, axis=1)
    back = np.take_along_axis(np.where(crossed.counts, back, -np.inf), order, axis=1)
    reached = np.maximum.accumulate(back, axis=1)
    before = np.concatenate([np.full((len(edge), 1), -np.inf), reached[:, :-1]], axis=1)
    new = np.where(np.isfinite(front), back - np.maximum(front, before), 0.0)
    return weight * np.maximum(new, 0.0).sum(axis=1), weight * whole
