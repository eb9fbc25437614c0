"""kernels/radiosity/volume.clh: radiance between the middles of cells, held to float64."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from ssgi_cl.device.constants import VOLUME_CELLS
from ssgi_cl.device.runtime import Runtime

from .expression import run_expressions

Doubles = NDArray[np.float64]
FACES, BEFORE, UNLIKE = 6, 0.01, 3.0
SMOOTH = "({{vfloat found[3]; volume_smooth(cells, records, x, y, z, nx, ny, nz, found); found[{}];}})"


def smooth(
    runtime: Runtime, cells: NDArray[np.int32], records: NDArray[np.float32], place: Doubles, normal: Doubles
) -> Doubles:
    """Return radiance [n, 3]; `cells` with what follows them, see the header."""
    names = ("x", "y", "z", "nx", "ny", "nz")
    lanes = dict(zip(names, np.concatenate([place, normal], axis=1).T.astype(np.float32), strict=True))
    found = run_expressions(
        runtime,
        "radiosity/volume.clh",
        {str(c): SMOOTH.format(c) for c in range(3)},
        tables={"cells": cells, "records": records.ravel()},
        **lanes,
    )
    return np.stack([found[str(c)] for c in range(3)], axis=1).astype(np.float64)


def expected(
    cells: NDArray[np.int32], planes: NDArray[np.float32], records: NDArray[np.float32], place: Doubles, normal: Doubles
) -> Doubles:
    """Return the same in float64: the mean of the four cells beside each other along the surface, by areas and by how
    alike their brightness and that of the place's own cell are."""
    found = np.zeros((len(place), 3))
    for number, (at, way) in enumerate(zip(place - BEFORE * normal, normal, strict=True)):
        faced = int(np.abs(way).argmax())

        def sent(cell: Doubles, at: Doubles = at, side: int = 2 * faced + int(way[faced] > 0.0)) -> Doubles:
            x, y, z = np.clip(cell, 0, VOLUME_CELLS - 1).astype(int)
            record = int(cells[z, y, x])
            if record < 0:
                plane = planes[-1 - record]
                record = 2 * (-1 - record) + int(plane[:3] @ at < plane[3])
            light: Doubles = records[record, side].astype(np.float64)
            return light

        own, total = sent(np.floor(at))[:3].sum(), 0.0
        for step in itertools.product((0, 1), repeat=3):
            if step[faced]:
                continue
            low = np.floor(at - 0.5)
            cell, counts = np.floor(at), 1.0
            for axis in {0, 1, 2} - {faced}:
                cell[axis] = low[axis] + step[axis]
                part = at[axis] - 0.5 - low[axis]
                counts *= part if step[axis] else 1.0 - part
            one = sent(cell)
            bright = one[:3].sum()
            counts *= one[3] * np.clip(UNLIKE - max(bright, own) / min(bright, own), 0.0, 1.0)
            found[number] += counts * one[:3]
            total += counts
        found[number] /= total
    return found


@pytest.mark.parametrize("flat", [True, False])
def test_light_of_a_surface_is_bilinear_between_cells(
    variant_runtime: Runtime, flat: bool, rng: np.random.Generator
) -> None:
    planes = np.concatenate([rng.normal(size=(5, 3)), np.full((5, 1), 16.0)], axis=1)
    planes[:, :3] /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    planes = planes.astype(np.float32)
    records = rng.uniform(0.1, 1.0, (40, FACES, 4)).astype(np.float32)
    cells = rng.integers(-5, 40, (VOLUME_CELLS,) * 3).astype(np.int32)
    place = rng.uniform(-0.4, VOLUME_CELLS + 0.4, (2000, 3))
    normal = np.eye(3)[rng.integers(0, 3, 2000)] * rng.choice((-1.0, 1.0), (2000, 1))
    if not flat:
        normal = rng.normal(size=(2000, 3))
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    table = np.concatenate([cells.ravel(), planes.view(np.int32).ravel()])
    found = smooth(variant_runtime, table, records, place, normal)
    right = expected(cells, planes, records, place, normal)
    # Of places on the border between cells, or on a plane, rounding decides: 2 of 2000 may be so.
    off = np.abs(found - right).max(axis=1)
    assert np.sort(off)[-3] < 2e-4
    assert right.std() > 0.05


def test_it_changes_no_more_than_its_slope_along_a_surface(runtime: Runtime, rng: np.random.Generator) -> None:
    """No step where cells of up to twice the brightness of their neighbours meet, as a look-up of one cell has."""
    records = np.ones((VOLUME_CELLS, FACES, 4), np.float32)
    records[..., :3] = rng.uniform(0.5, 1.0, (VOLUME_CELLS, 1, 1))
    cells = np.broadcast_to(np.arange(VOLUME_CELLS, dtype=np.int32), (VOLUME_CELLS,) * 3)
    place = np.full((20001, 3), 7.3)
    place[:, 0] = np.linspace(0.0, 64.0, len(place))
    normal = np.tile((0.0, 1.0, 0.0), (len(place), 1))
    found = smooth(runtime, np.append(cells.ravel(), np.zeros(4, np.int32)), records, place, normal)
    assert np.abs(np.diff(found[:, 0])).max() < 1.01 * 64.0 / 20000 * np.abs(np.diff(records[:, 0, 0])).max()
    middles = np.interp(np.arange(64) + 0.5, place[:, 0], found[:, 0])
    np.testing.assert_allclose(middles, records[:, 0, 0], atol=1e-3)


def test_the_next_room_lends_no_light(runtime: Runtime) -> None:
    """A floor of which every other four cells are ten times as bright: walls may stand between them."""
    records = np.ones((VOLUME_CELLS, FACES, 4), np.float32)
    records[..., :3] = np.where(np.arange(VOLUME_CELLS) // 4 % 2, 10.0, 1.0)[:, None, None]
    cells = np.broadcast_to(np.arange(VOLUME_CELLS, dtype=np.int32), (VOLUME_CELLS,) * 3)
    place = np.full((20000, 3), 7.3)
    place[:, 0] = (np.arange(len(place)) + 0.5) * (64.0 / len(place))
    normal = np.tile((0.0, 1.0, 0.0), (len(place), 1))
    found = smooth(runtime, np.append(cells.ravel(), np.zeros(4, np.int32)), records, place, normal)
    own = records[np.floor(place[:, 0]).astype(int), 0, 0]
    np.testing.assert_allclose(found[:, 0], own, rtol=1e-6)
