"""Leaves on stems, which the wind bends."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ssgi_cl.bench.experiments.shots.shot import Shot, camera_at
from ssgi_cl.core.lights import SpotLight
from ssgi_cl.core.scene import Material
from ssgi_cl.device.arrays import Size
from ssgi_cl.rasterize.parts import Part, assemble
from ssgi_cl.rasterize.scenes.shapes import pole, quad

STEMS, LEAVES = 24, 9
HEIGHT = 1.2
"""Of a stem, scene units."""
SWAY = 0.12
"""Way of a stem's top to either side, scene units."""
PERIOD = 24.0
"""Frames of a swing."""


def foliage_in_wind(size: Size, frames: int) -> Iterator[Shot]:
    """Yield frames of a still camera before plants on a floor and before a wall: what is higher sways further, and
    gusts come from one side."""
    rng = np.random.default_rng(7)
    floor = quad([(-3, 0, 2), (3, 0, 2), (3, 0, -1.2), (-3, 0, -1.2)])
    wall = quad([(-3, 0, -1.2), (3, 0, -1.2), (3, 3, -1.2), (-3, 3, -1.2)])
    parts: list[Part] = [floor, wall]
    up = np.array([0.0, HEIGHT, 0.0])
    for foot in rng.uniform((-1.4, 0.0, -0.9), (1.4, 0.0, 0.5), (STEMS, 3)):
        parts.append(pole(foot, foot + up, 0.008, 5))
        for height in np.linspace(0.25, 1.0, LEAVES):
            angle, tilt = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(-0.1, 0.15)
            along = np.array([np.cos(angle), tilt, np.sin(angle)]) * rng.uniform(0.12, 0.22)
            across = np.array([-np.sin(angle), 1.2, np.cos(angle)]) * 0.04
            stem, middle = foot + height * up, foot + height * up + along / 2.0
            parts.append(quad([stem, middle - across, stem + along, middle + across]))
    plants = assemble(parts, [Material()])
    still = np.asarray(plants.positions)
    lamp = SpotLight((1.5, 2.8, 2.0), (-1.3, -2.2, -2.2), 1.0, (30.0, 28.0, 24.0))
    camera = camera_at((0.3, 1.1, 2.6), (0.0, 0.7, -0.3), 0.8, size)
    place = still + plants.origin
    bent = np.where((place[:, 1] > 0.0) & (place[:, 2] > -1.19), (place[:, 1] / HEIGHT) ** 2, 0.0)
    for number in range(frames):
        way = SWAY * bent * np.sin(2.0 * np.pi * number / PERIOD - 2.0 * place[:, 0])
        positions = still.copy()
        positions[:, 0] += way
        yield Shot(replace(plants, positions=positions), camera, 0.3, (lamp,))
