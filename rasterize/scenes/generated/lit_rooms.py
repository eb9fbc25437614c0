"""Small closed rooms by one light each, which nothing is tuned on: they validate whole frames.

Boxes and balls stand in them. "panel": an emissive panel under the ceiling; "rods": the same with nine
rods from floor to ceiling; "window": sun and sky through an opening; "spot" and "point": such a light.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from ssgi_cl.core.lights import DirectionalLight, Environment, Light, PointLight, SpotLight
from ssgi_cl.core.scene import Material

from ..scatter import about_y
from .chance import Chance
from .draft import Draft, Ground, inside_views
from .model import COLOURS, MATERIALS, PAINT, PLASTER, STEEL, WOOD, Model

PANEL = len(MATERIALS)
_MATERIALS = (*MATERIALS, Material(name="panel", albedo=(0.7, 0.7, 0.7), emission=(14.0, 13.0, 11.0)))
_THICK = 0.2
"""Of walls, metres."""
RODS = 9


def _room(kind: str, chance: Chance) -> Draft:
    wide, deep, high = chance.uniform(3.4, 4.6), chance.uniform(3.4, 4.6), chance.uniform(2.5, 3.1)
    model, ground = Model(_MATERIALS), Ground()
    _shell(model, chance, wide, deep, high, window=kind == "window")
    lights = _lights(model, chance, kind, wide, deep, high)
    inner = (-0.36 * wide, 0.36 * wide, -0.36 * deep, 0.36 * deep)
    for x, z in ground.places(chance, inner, 0.75, 0.75, chance.whole(2, 3)):
        size = chance.uniform(0.35, 0.6), chance.uniform(0.3, 1.2), chance.uniform(0.35, 0.6)
        turn = about_y(chance.uniform(0.0, 1.57))
        tint = chance.pick(COLOURS)
        model.put("box", (x, 0.5 * size[1], z), size, PAINT, turn=turn, tint=tint)
    for x, z in ground.places(chance, inner, 0.5, 0.5, chance.whole(1, 2)):
        radius = chance.uniform(0.12, 0.25)
        model.put("ball", (x, radius, z), radius, PAINT, tint=chance.pick(COLOURS))
    for x, z in ground.places(chance, inner, 0.16, 0.16, RODS if kind == "rods" else chance.whole(0, 2)):
        model.bar((x, 0.0, z), (x, high, z), chance.uniform(0.012, 0.06), STEEL, sides=16)
    views = inside_views(chance, wide, deep, 60, far=(0.4, 0.3), eye=(1.0, 1.7), target=(0.7, 1.3), spread=0.4)
    return Draft(model, views, lights, ao_radius=0.3, yfov=chance.uniform(0.9, 1.15), clearance=0.2, coverage=0.9)


def _shell(model: Model, chance: Chance, wide: float, deep: float, high: float, *, window: bool) -> None:
    """Add floor, ceiling and walls, of which that of +x may have an opening."""
    x, z, t = 0.5 * wide, 0.5 * deep, _THICK
    left, back = chance.uniforms(0.55, 1.05, 3), chance.uniforms(0.55, 1.05, 3)
    model.box((-x - t, -t, -z - t), (x + t, 0.0, z + t), WOOD)
    model.box((-x - t, high, -z - t), (x + t, high + t, z + t), PLASTER)
    model.box((-x - t, 0.0, -z - t), (x + t, high, -z), PLASTER, back)
    model.box((-x - t, 0.0, z), (x + t, high, z + t), PLASTER)
    model.box((-x - t, 0.0, -z), (-x, high, z), PLASTER, left)
    if not window:
        model.box((x, 0.0, -z), (x + t, high, z), PLASTER)
        return
    sill, top, side = chance.uniform(0.6, 0.9), high - chance.uniform(0.3, 0.5), chance.uniform(0.2, 0.32) * deep
    for low, up in (
        ((0.0, -z), (sill, z)),
        ((top, -z), (high, z)),
        ((sill, -z), (top, -side)),
        ((sill, side), (top, z)),
    ):
        model.box((x, *low), (x + t, *up), PLASTER)


def _lights(model: Model, chance: Chance, kind: str, wide: float, deep: float, high: float) -> tuple[Light, ...]:
    """Return the lights, and add a panel where it is one."""
    aside, along = chance.uniform(-0.2, 0.2) * wide, chance.uniform(-0.2, 0.2) * deep
    if kind in ("panel", "rods"):
        across, length = chance.uniform(0.3, 0.6), chance.uniform(0.5, 1.2)
        low = (aside - 0.5 * across, high - 0.06, along - 0.5 * length)
        model.box(low, (aside + 0.5 * across, high - 0.02, along + 0.5 * length), PANEL)
        return ()
    if kind == "window":
        sun = DirectionalLight((-0.8, -0.6, chance.uniform(-0.4, 0.4)), (14.0, 12.5, 10.0))
        return sun, Environment((0.9, 0.95, 1.05))
    if kind == "spot":
        return (SpotLight((aside, high - 0.1, along), (-0.4 * aside, -1.0, -0.4 * along), 0.6, (30.0, 27.0, 23.0)),)
    return (PointLight((aside, high - chance.uniform(0.4, 0.9), along), (7.0, 6.4, 5.4)),)


LIT_ROOMS: dict[str, Callable[[Chance], Draft]] = {
    kind: partial(_room, kind) for kind in ("panel", "window", "rods", "spot", "point")
}
"""Functions that make a room of each kind, by name."""
