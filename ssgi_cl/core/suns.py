"""The small bright sources of environments as directional lights of their own.

Directions of equal flux crowd in a sun, each with a coarse depth map of all the scene, and leave
few for the sky. A light has one map, fitted to what is seen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.environment_samples import BRIGHTEST, LUMINANCE, solid_angles, texels
from ssgi_cl.core.keywords import checked_keywords
from ssgi_cl.core.lights import DirectionalLight, Environment, Light

Doubles = NDArray[np.float64]

SUN_RADIUS = 0.05
"""Radians from the middle of what may be a sun to its rim."""
SUN_SHARE = 0.1
"""Of an environment's luminous flux, the least that a sun has. Against paths, splitting a sun that
has .8 of it leaves a third of whole frames' mean error, .3 two thirds, .1 nine tenths, .04 all."""
MOST_SUNS = 4

_MOST_SHIFTS = 16  # of a disc towards the middle of what shines in it

_split: WeakKeyDictionary[Environment, tuple[tuple[DirectionalLight, ...], Environment | None]] = WeakKeyDictionary()


@checked_keywords
def split_suns(environment: Environment) -> tuple[tuple[DirectionalLight, ...], Environment]:
    """Return the small bright sources of an environment as lights, and the environment without.

    A source is a sun if a disc of `SUN_RADIUS` radians holds at least `SUN_SHARE` of all flux,
    which is 160 times as much as a disc of an even sky. The light's `angle` is that of a
    disc of the source's effective solid angle. The radiance round a source takes its place; what it
    loses is the light's irradiance, so that their sum stays the same. Computed once for an
    environment.
    """
    found = _split.get(environment)
    if found is None:
        suns, rest = _found(environment)
        # An environment that refers to itself would be kept forever.
        found = _split[environment] = (suns, rest if suns else None)
    return found[0], found[1] or environment


def lights_with_suns(lights: Sequence[Light]) -> tuple[tuple[Light, ...], str | None]:
    """Return lights with the suns of environments as lights of their own, and a note or None.

    Environments keep their places and lose their suns, which come after all lights.
    """
    kept: list[Light] = []
    suns: list[DirectionalLight] = []
    for light in lights:
        if isinstance(light, Environment):
            found, light = split_suns(light)
            suns += found
        kept.append(light)
    if not suns:
        return tuple(lights), None
    each = ", ".join(
        f"{np.asarray(sun.irradiance) @ LUMINANCE:.3g} W/m^2 from {math.degrees(2 * sun.angle):.2g}" for sun in suns
    )
    return (*kept, *suns), (
        f"environments' small bright sources ({each} degrees) are directional lights with shadow maps"
    )


def _found(environment: Environment) -> tuple[tuple[DirectionalLight, ...], Environment]:
    image = np.asarray(environment.radiance, np.float64)
    if image.ndim == 1 or max(math.pi / image.shape[0], 2 * math.pi / image.shape[1]) > SUN_RADIUS:
        return (), environment
    image = np.minimum(image, BRIGHTEST)
    solid = solid_angles(*image.shape[:2])
    suns: list[DirectionalLight] = []
    while len(suns) < MOST_SUNS:
        total = float((image @ LUMINANCE).sum(axis=1) @ solid)
        found = _sun(image, SUN_SHARE * total) if total > 0.0 else None
        if found is None:
            break
        sun, rows, rest = found
        suns.append(sun)
        image[rows] = rest
    return (tuple(suns), Environment(image)) if suns else ((), environment)


def _sun(image: Doubles, least: float) -> tuple[DirectionalLight, slice, Doubles] | None:
    """Return the brightest source as a light, the rows that have it, and these without.

    Args:
        image: [rows, columns, 3] radiance.
        least: W/m^2, luminous, of a sun.
    """
    height, width = image.shape[:2]
    bright = image @ LUMINANCE
    row, column = np.unravel_index(int(bright.argmax()), bright.shape)
    # A disc round its middle lies within SUN_RADIUS of the peak, and the ring round it twice that.
    reach = math.ceil(3.0 * SUN_RADIUS / math.pi * height) + 1
    rows = slice(max(int(row) - reach, 0), int(row) + reach + 1)
    band = image[rows]
    towards, omega = texels(height, width, rows)
    power = bright[rows] * omega
    centre = towards[int(row) - rows.start, int(column)]
    for _ in range(_MOST_SHIFTS):
        disc = towards @ centre >= math.cos(SUN_RADIUS)
        before, centre = centre, power[disc] @ towards[disc]
        centre = centre / np.linalg.norm(centre)
        if float(np.abs(centre - before).max()) < 1e-4:
            break
    cosine = towards @ centre
    disc = cosine >= math.cos(SUN_RADIUS)
    if float(power[disc].sum()) < least:
        return None
    ring = ~disc & (cosine >= math.cos(2.0 * SUN_RADIUS))
    around = np.median(band[ring], axis=0) if ring.any() else np.zeros(3)
    areas = omega[disc]
    excess = np.maximum(band[disc] - around, 0.0) * areas[:, None]
    strength = excess @ LUMINANCE
    if strength.sum() < 0.5 * least:
        return None  # as bright round it: not a small source
    # The solid angle that the same flux would fill evenly.
    effective = strength.sum() ** 2 / (strength**2 / areas).sum()
    angle = min(math.sqrt(effective / math.pi), SUN_RADIUS)
    rest = band.copy()
    rest[disc] = np.minimum(band[disc], around)
    sun = DirectionalLight(-(strength @ towards[disc]), excess.sum(axis=0), angle=angle)
    return sun, rows, rest
