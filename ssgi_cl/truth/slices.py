"""Same-assumption truth of HBAO, GTAO and the visibility bitmask: a dense march through the layers.

It shares nothing with the kernels but the definition of what a depth buffer holds: planes through
the view ray are evenly spread in azimuth round it, and every pixel that they cross counts,
from where taps begin. So many reads are affordable for some of the pixels only, which are spread
over the image.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.sampling import r_points
from ssgi_cl.device.constants import SLICES_NEAREST_TAP
from ssgi_cl.device.progress import Progress
from ssgi_cl.reference.ao.facets import tilted
from ssgi_cl.reference.gbuffer import Doubles, SurfaceView
from ssgi_cl.techniques.ao.bitmask import BitmaskParams
from ssgi_cl.techniques.ao.hbao import HbaoParams
from ssgi_cl.techniques.ao.slices import SliceParams
from ssgi_cl.truth.digests import camera_description, digest
from ssgi_cl.truth.estimators import versioned
from ssgi_cl.truth.horizons import Crossed, Plane, check_technique, hidden_and_whole
from ssgi_cl.truth.pixels import Pixels, spread_pixels
from ssgi_cl.truth.store import Truth, accumulated

PASS_SLICES = 8
"""Of a pass: evenly turned, each pass by another angle."""

CHUNK = 256
"""Pixels that are marched at a time."""

LEAST_N_DOT_V = 0.05
"""Cosine that a grazing or averted normal is taken to have with the view ray."""

NOT_OF_THE_MODEL = (
    "slices",
    "taps",
    "tap_power",
    "resolution",
    "blur_radius",
    "blur_passes",
    "blur_resolution",
    "contrast",
    "frame",
)
"""Parameters that say how well occlusion is sampled, not what it is; contrast is told apart."""


def converged(
    gbuffer: GBuffer,
    params: SliceParams,
    *,
    pixels: int = 4096,
    slices: int = 64,
    rebuild: bool = False,
    progress: Progress = None,
) -> Truth:
    """Return the A that a technique of slices tends to: ever more slices and taps, no blur.

    Args:
        gbuffer: all of its layers, and its margin, are marched through.
        params: of HBAO, GTAO or the bitmask; numbers of slices and taps, resolution and blur do not
            matter.
        pixels: how many are computed, evenly spread over those that show something; all of them if
            there are no more.
        slices: of each, 1 to 2^16; rounded up to a multiple of 8.
        rebuild: make it anew, whatever is kept.
        progress: called with the share that is done, which grows to 1. True: a bar in terminals and notebooks.

    Returns:
        Mean A [rows, columns] float32 in [0, 1], NaN where it was not computed, 1 where nothing is;
        and the standard error of the slices, infinite from a single pass of 8. What is measured on
        n of all pixels has an error of its own, that of n draws.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range; the bitmask's joined
            surfaces, which are another model.
        TruthError: what is kept is damaged; see `ssgi_cl.truth.store.accumulated`.
    """
    if not isinstance(gbuffer, GBuffer):
        raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected an ssgi_cl.GBuffer")
    pixels = checks.integer("pixels", pixels, low=1, high=1 << 24)
    slices = checks.integer("slices", slices, low=1, high=1 << 16)
    check_technique(params)
    march = March.of(gbuffer, params)
    taken = spread_pixels(march.seen, pixels)
    values = asdict(params)
    description = {
        "kind": "slices",
        "technique": type(params).__name__,
        "camera": camera_description(gbuffer.camera),
        "gbuffer": digest(np.asarray(gbuffer.depth), gbuffer.first("normal"), gbuffer.exact),
        "pixels": pixels,
        "slices": PASS_SLICES,
        "nearest": SLICES_NEAREST_TAP,
        "model": {name: values[name] for name in values if name not in NOT_OF_THE_MODEL},
        "estimator": versioned("slices"),
    }

    def estimate(number: int) -> Doubles:
        image = np.ones(gbuffer.size)
        image[taken] = march.visibility(taken, number)
        return image

    truth = accumulated(description, -(-slices // PASS_SLICES), estimate, rebuild=rebuild, progress=progress)
    unknown = march.seen.copy()
    unknown[taken] = False
    mean = truth.mean.astype(np.float64)
    # d(A^c) = c A^(c - 1) dA; no A is off by more than 1.
    slope = params.contrast * np.maximum(mean, 1e-6) ** (params.contrast - 1.0)
    error = np.minimum(truth.error * slope, np.where(np.isinf(truth.error), np.inf, 1.0))
    return Truth(
        np.where(unknown, np.nan, mean**params.contrast).astype(np.float32),
        np.where(unknown, np.nan, error).astype(np.float32),
        truth.passes,
        digest(truth.key, params.contrast),
    )


@dataclass(frozen=True, eq=False)
class March:
    """The pixels of a G-buffer as receivers, and all of its layers as occluders.

    Attributes:
        view: the front layer; its normals are those of tangent planes.
        own: [rows, columns, 3] of the arrays: normals that are not across these planes, see `tilted`.
        share: [rows, columns] of the image: what of their hemisphere lies above the planes.
        params: of the technique.
        there: [layers, rows, columns], margin included: whether a surface is there.
        position: [layers, rows, columns, 3] view space, 0 where nothing is.
        reach: [rows, columns] of the image: distance up to which surfaces occlude, scene units; 0
            where that is less than a pixel.
        seen: [rows, columns]: where something is.
    """

    view: SurfaceView
    own: Doubles
    share: Doubles
    params: SliceParams
    there: NDArray[np.bool_]
    position: Doubles
    reach: Doubles
    seen: NDArray[np.bool_]

    @classmethod
    def of(cls, gbuffer: GBuffer, params: SliceParams) -> March:
        """Return that of a G-buffer."""
        view = SurfaceView.of(gbuffer)
        depths = np.asarray(gbuffer.depth, np.float64).reshape(gbuffer.layers, *view.depth.shape)
        there = np.isfinite(depths)
        row, column = view.centres()
        position = np.stack(
            [view.position(row, column, np.where(mask, depth, 0.0)) for mask, depth in zip(there, depths, strict=True)]
        )
        own = view.inner(view.depth)
        seen = np.isfinite(own)
        wanted_px = params.radius * view.pixels_per_unit(np.where(seen, own, 1.0))
        reach = params.radius * np.minimum(1.0, params.max_radius_px / wanted_px)
        reach = np.where(np.minimum(wanted_px, params.max_radius_px) >= 1.0, reach, 0.0)
        facing = _turned_back(view, position[0])
        known, facet = tilted(view)
        cosine = np.clip(np.sum(facet * view.normal, axis=-1), -1.0, 1.0)
        open_ = 1.0 - np.arccos(cosine) / np.pi if isinstance(params, HbaoParams) else 0.5 * (1.0 + cosine)
        planes = replace(facing, normal=np.where(known[..., None], facet, facing.normal))
        share = view.inner(np.where(known, open_, 1.0))
        return cls(planes, facing.normal, share, params, there, position, reach, seen)

    def visibility(self, pixels: Pixels, number: int) -> Doubles:
        """Return A [count] of some pixels, from the slices of a pass, before contrast."""
        result = np.ones(len(pixels[0]))
        # Pixels with the same reach on the screen march together.
        order = np.argsort(self._lengths(pixels))
        turns = r_points(0, len(order), 1)[:, 0]
        for start in range(0, len(order), CHUNK):
            chosen = order[start : start + CHUNK]
            chunk = (pixels[0][chosen], pixels[1][chosen])
            hidden, whole = np.zeros(len(chosen)), np.full(len(chosen), 1e-30)
            # Every pixel turns its slices by another angle, and so does every pass.
            turn = np.mod(turns[chosen] + r_points(number, number + 1, 1)[0], 1.0)
            for index in range(PASS_SLICES):
                azimuth = np.pi * (index + turn) / PASS_SLICES
                for plane, crossed in self._sides(chunk, azimuth):
                    more_hidden, more = hidden_and_whole(self.params, plane, crossed)
                    hidden += more_hidden
                    whole += more
            result[chosen] = np.clip(1.0 - hidden / whole, 0.0, 1.0) * self.share[chunk]
        return result

    def _lengths(self, pixels: Pixels) -> Doubles:
        """Return after how many pixels' widths the march has left the reach of each pixel."""
        depth = self.view.inner(self.view.depth)[pixels]
        reach = self.reach[pixels]
        # What is nearer to the eye than the receiver looks larger.
        nearest = depth if self.view.camera.is_orthographic else depth - reach
        diagonal = math.hypot(*self.view.depth.shape)
        nearest = np.maximum(nearest, 1e-9 * depth)
        px = np.minimum(reach * self.view.pixels_per_unit(nearest) + 1.0, diagonal)
        # Off the middle of the image a unit covers more pixels.
        view_ray = self.position[0][self._at(pixels)] / depth[:, None]
        tilt = 1.0 if self.view.camera.is_orthographic else np.sum(view_ray**2, axis=-1)
        result: Doubles = np.minimum(px * tilt, diagonal)
        return result

    def _at(self, pixels: Pixels) -> Pixels:
        """Return where pixels of the image lie in the arrays."""
        return pixels[0] + self.view.margin[0], pixels[1] + self.view.margin[1]

    def _sides(self, pixels: Pixels, azimuth: Doubles) -> Iterator[tuple[Plane, Crossed]]:
        """Give both sides of the slices at an azimuth, and what each of them crosses."""
        view = self.view
        at = self._at(pixels)
        receiver, normal, own = self.position[0][at], view.normal[at], self.own[at]
        if view.camera.is_orthographic:
            view_ray = np.tile([0.0, 0.0, 1.0], (len(azimuth), 1))
        else:
            view_ray = -receiver / np.linalg.norm(receiver, axis=-1, keepdims=True)
        first = np.cross([0.0, 1.0, 0.0], view_ray)
        first /= np.linalg.norm(first, axis=-1, keepdims=True)
        second = np.cross(view_ray, first)
        along = np.cos(azimuth)[:, None] * first + np.sin(azimuth)[:, None] * second
        facing, n_dot_v = (np.maximum(np.sum(n * view_ray, axis=-1), LEAST_N_DOT_V) for n in (normal, own))
        tangent, lean = (np.sum(n * along, axis=-1) for n in (normal, own))
        # The plane holds the eye, so that it is seen as a line.
        row, column = at[0] + 0.5, at[1] + 0.5
        near_row, near_column = view.pixel(receiver + 1e-3 * view.depth[at][:, None] * along)
        to_row, to_column = near_row - row, near_column - column
        length = np.hypot(to_row, to_column)
        to_row, to_column = to_row / length, to_column / length
        distance = _chords(to_row, to_column, float(self._lengths(pixels).max()))
        for side in (1.0, -1.0):
            plane = Plane(edge=-side * tangent / facing, facing=facing, n_dot_v=n_dot_v, lean=side * lean)
            i = np.floor(row[:, None] + side * distance * to_row[:, None]).astype(np.intp)
            j = np.floor(column[:, None] + side * distance * to_column[:, None]).astype(np.intp)
            yield plane, self._crossed(pixels, (i, j), view_ray, plane)

    def _crossed(self, pixels: Pixels, place: Pixels, view_ray: Doubles, plane: Plane) -> Crossed:
        """Return what the array elements `place` [count, steps] hold in all layers."""
        rows, columns = self.view.depth.shape
        at, (i, j) = self._at(pixels), place
        inside = (i >= 0) & (i < rows) & (j >= 0) & (j < columns)
        inside &= (i != at[0][:, None]) | (j != at[1][:, None])
        i, j = np.clip(i, 0, rows - 1), np.clip(j, 0, columns - 1)
        receiver, normal = self.position[0][at][:, None], self.view.normal[at]
        reach = self.reach[pixels][:, None]
        parts = []
        for there, position in zip(self.there, self.position, strict=True):
            front = position[i, j]
            offset = front - receiver
            distance = np.linalg.norm(offset, axis=-1)
            excess = self._excess(offset, view_ray, normal, plane, self.params.bias * reach)
            cot = plane.edge[:, None] + np.maximum(excess, 0.0)
            back = cot
            if isinstance(self.params, BitmaskParams):
                behind = self._moved(front, self.params.thickness * reach) - receiver
                lower = self._excess(behind, view_ray, normal, plane, 0.0)
                back = plane.edge[:, None] + np.maximum(lower, 0.0)
            parts.append(
                Crossed(
                    counts=inside & there[i, j] & (distance <= reach) & (excess > 0.0),
                    cot=cot,
                    back=back,
                    distance=distance / np.maximum(reach, 1e-30),
                    depth=-offset[..., 2] / np.maximum(reach, 1e-30),
                )
            )
        return parts[0] if len(parts) == 1 else Crossed.merged(parts)

    def _moved(self, point: Doubles, depth: Doubles) -> Doubles:
        """Return points [..., 3] moved by some depth along their view rays."""
        if self.view.camera.is_orthographic:
            return point - depth[..., None] * [0.0, 0.0, 1.0]
        result: Doubles = point * (1.0 + depth / np.maximum(-point[..., 2], 1e-30))[..., None]
        return result

    @staticmethod
    def _excess(offset: Doubles, view_ray: Doubles, normal: Doubles, plane: Plane, bias: Doubles | float) -> Doubles:
        """Return by how much the cotangent from the view ray exceeds the tangent plane's.

        A pixel's centre lies a little beside the slice: it is turned into it about the view
        ray so that what lies in the tangent plane stays in it.
        """
        towards = np.einsum("psk,pk->ps", offset, view_ray)
        across = np.sqrt(np.maximum(np.sum(offset**2, axis=-1) - towards**2, 0.0))
        height = np.einsum("psk,pk->ps", offset, normal) - bias
        result: Doubles = height / np.maximum(across * plane.facing[:, None], 1e-30)
        return result


def _turned_back(view: SurfaceView, position: Doubles) -> SurfaceView:
    """Return a view whose averted normals are turned back along the view ray."""
    view_ray = np.broadcast_to([0.0, 0.0, 1.0], position.shape)
    if not view.camera.is_orthographic:
        view_ray = -position / np.maximum(np.linalg.norm(position, axis=-1, keepdims=True), 1e-30)
    n_dot_v = np.sum(view.normal * view_ray, axis=-1, keepdims=True)
    back = np.where(n_dot_v < 0.0, np.minimum(-n_dot_v, LEAST_N_DOT_V) - n_dot_v, 0.0) * view_ray
    return replace(view, normal=view.normal + back)


def _chords(to_row: Doubles, to_column: Doubles, length: float) -> Doubles:
    """Return [count, chords] the middles of what lines cut off the pixels on their way, px.

    Each line starts at a pixel's centre. What it cuts off before `SLICES_NEAREST_TAP`, where no
    technique looks, is moved there: the pixel that is crossed there comes several times.

    Args:
        to_row, to_column: [count] directions of unit length.
        length: how far the lines go at least, px.
    """
    # A line leaves a row or a column half a pixel from its start, and then with every pixel.
    edges = np.arange(math.ceil(length) + 1) + 0.5
    ends = np.sort(
        np.concatenate([edges / np.maximum(np.abs(to), 1e-12)[:, None] for to in (to_row, to_column)], axis=1), axis=1
    )
    # Lines along an axis cross half as many edges; the others lie far beyond their reach.
    ends = np.clip(ends, SLICES_NEAREST_TAP, length + 2.0)
    result: Doubles = 0.5 * (ends[:, :-1] + ends[:, 1:])
    return result
