"""A columned hall, open to the sun on one side: columns, arches, railings, cloth, round objects.

Metres; the nave runs along z, from the apse at -z to the entrance wall at +z; the open side is +x.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core.lights import DirectionalLight, Environment, SpotLight
from ssgi_cl.core.scene import Material

from ..parts import Part, assemble, complete
from . import shapes
from .builtin import BuiltinScene
from .furnishings import banner, railing
from .shapes import box, grid, joined, lathe, moved, of_material, rounded, tube, turned

_MATERIALS = (
    Material(name="limestone", albedo=(0.70, 0.64, 0.54)),
    Material(name="plaster", albedo=(0.76, 0.73, 0.68)),
    Material(name="floor", albedo=(0.62, 0.57, 0.50)),
    Material(name="iron", albedo=(0.09, 0.09, 0.10), specular=(0.2, 0.2, 0.2), gloss=40.0),
    Material(name="red cloth", albedo=(0.62, 0.05, 0.04)),
    Material(name="green cloth", albedo=(0.06, 0.38, 0.09)),
    Material(name="blue cloth", albedo=(0.05, 0.11, 0.50)),
    Material(name="terracotta", albedo=(0.58, 0.26, 0.14), specular=(0.04, 0.04, 0.04), gloss=20.0),
    Material(name="bronze", albedo=(0.33, 0.22, 0.09), specular=(0.35, 0.25, 0.12), gloss=60.0),
    Material(name="marble", albedo=(0.82, 0.81, 0.79), specular=(0.05, 0.05, 0.05), gloss=80.0),
    Material(name="gold cloth", albedo=(0.66, 0.42, 0.06)),
)
(
    _STONE, _PLASTER, _FLOOR, _IRON, _RED, _GREEN, _BLUE, _TERRACOTTA, _BRONZE, _MARBLE, _GOLD,
) = range(len(_MATERIALS))  # fmt: skip

_BAY = 3.0
_COLUMNS_Z = -13.5 + _BAY * np.arange(10)
_ROW_X = 3.6
"""Distance of the rows of columns from the middle."""
_OUTER_X = 7.5
_END_Z = 15.0
_SPRINGING = 4.4
"""Height from which the arches rise, the top of the columns."""
_ARCH_RADIUS = 1.15
_GALLERY = 6.4
_VAULT = 9.6
"""Height from which the vault rises."""


def hall() -> BuiltinScene:
    """Make the hall: about 480,000 triangles, 30 m long, always the same.

    The sun comes in over the open side; the sky is a constant environment; a spot light shines on
    the sphere before the apse. The iron bars are 16 mm thick.
    """
    one_side = joined([*_columns(), *_arcade(), *_gallery(), of_material(_cornice(), _STONE), *_spandrel_cloth()])
    one_side = complete(one_side)
    parts = [one_side, shapes.mirrored_x(one_side), *_floor(), *_walls(), *_vault(), *_apse(), *_things()]
    lights = (
        DirectionalLight(direction=(-0.80, -0.46, -0.34), irradiance=(20.0, 17.5, 13.5)),
        Environment(radiance=(0.75, 1.0, 1.45)),
        SpotLight(
            position=(0.0, 8.5, -6.5), direction=(0.0, -0.72, -0.60), cone_angle=0.45, intensity=(300.0, 240.0, 160.0)
        ),
    )
    return BuiltinScene(
        name="hall",
        scene=assemble(parts, _MATERIALS),
        eye=(1.5, 1.9, 12.2),
        target=(-0.9, 3.5, -2.0),
        yfov=1.05,
        lights=lights,
        ao_radius=0.8,
    )


def _columns() -> list[Part]:
    def flutes(angle: NDArray[np.float64], height: NDArray[np.float64]) -> NDArray[np.float64]:
        # Shallow scoops with a narrow ridge between them, running out at both ends.
        ends = np.clip(np.minimum(height - 0.45, 3.85 - height) / 0.12, 0.0, 1.0)
        scoops: NDArray[np.float64] = 1.0 - 0.075 * np.sqrt(ends) * np.abs(np.sin(8.0 * angle))
        return scoops

    height = np.concatenate([np.linspace(0.42, 0.62, 5), np.linspace(1.0, 3.4, 6)])
    height = np.concatenate([height, np.linspace(3.68, 3.88, 5)])
    along = (height - 0.42) / 3.46
    swelling = 0.34 - 0.05 * along**1.6  # entasis: the shaft thins faster the higher it gets
    shaft = lathe(np.stack([swelling, height], axis=1), 96, shape=flutes)
    torus = rounded([(0.44, 0.14), (0.48, 0.18), (0.48, 0.24), (0.43, 0.28)], 4)
    scotia = rounded([(0.38, 0.29), (0.37, 0.33), (0.40, 0.36), (0.36, 0.41), (0.33, 0.43)], 3)
    base = lathe(np.concatenate([torus, scotia]), 48)

    def leaves(angle: NDArray[np.float64], height: NDArray[np.float64]) -> NDArray[np.float64]:
        # Two rows of eight leaves that lean outwards at their tips.
        bell = np.clip((height - 3.92) / 0.36, 0.0, 1.0)
        row = np.where(bell < 0.5, 0.0, 0.5)
        tip = 2.0 * (bell - row)
        leaning: NDArray[np.float64] = 1.0 + 0.16 * tip**2 * np.abs(np.cos(4.0 * angle + 2.0 * row * np.pi / 2.0))
        return leaning

    bell_height = np.linspace(3.92, 4.28, 13)
    bell = 0.29 + 0.11 * ((bell_height - 3.92) / 0.36) ** 2
    capital = [
        lathe(rounded([(0.29, 3.84), (0.33, 3.87), (0.33, 3.90), (0.29, 3.92)], 3), 48),
        lathe(np.stack([bell, bell_height], axis=1), 64, shape=leaves),
        box((-0.46, 4.28, -0.46), (0.46, _SPRINGING, 0.46)),
    ]
    column = joined([box((-0.5, 0.0, -0.5), (0.5, 0.14, 0.5)), base, shaft, *capital])
    column = complete(of_material(column, _STONE))
    return [moved(column, _ROW_X, 0.0, z) for z in _COLUMNS_Z]


def _arcade() -> list[Part]:
    """Return the wall on the columns, pierced by an arch in each bay."""
    inner, outer, top = _ROW_X - 0.3, _ROW_X + 0.3, _GALLERY - 0.3
    angle = np.linspace(0.0, np.pi, 41)
    arch = _ARCH_RADIUS * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # The rays through the arch's points, prolonged to the upper and side edges of the bay.
    reach = np.minimum(
        0.5 * _BAY / np.maximum(np.abs(np.cos(angle)), 1e-9), (top - _SPRINGING) / np.maximum(np.sin(angle), 1e-9)
    )
    edge = arch / _ARCH_RADIUS * reach[:, None]
    corner = np.arctan2(top - _SPRINGING, 0.5 * _BAY)
    for side, z in ((corner, 0.5 * _BAY), (np.pi - corner, -0.5 * _BAY)):
        edge[np.abs(angle - side).argmin()] = z, top - _SPRINGING

    def at(x: float, outline: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([np.full(len(outline), x), _SPRINGING + outline[:, 1], outline[:, 0]], axis=1)

    def bar(x: float, radius: float, thickness: float) -> Part:
        outline = arch / _ARCH_RADIUS * radius
        return tube(at(x, outline), (1.0, 0.0, 0.0), thickness, 12)

    bay = joined([
        grid(np.stack([at(inner, arch), at(inner, edge)])[:, ::-1]),
        grid(np.stack([at(outer, edge), at(outer, arch)])[:, ::-1]),
        grid(np.stack([at(outer, arch), at(inner, arch)])[:, ::-1]),
        bar(inner, _ARCH_RADIUS + 0.05, 0.045),
        bar(inner, _ARCH_RADIUS + 0.22, 0.03),
        bar(outer, _ARCH_RADIUS + 0.05, 0.045),
    ])  # fmt: skip
    bay = complete(of_material(bay, _STONE))
    middles = np.concatenate([[_COLUMNS_Z[0] - 0.5 * _BAY], _COLUMNS_Z + 0.5 * _BAY])
    return [moved(bay, 0.0, 0.0, z) for z in middles[1:-1]] + [
        of_material(box((inner, _SPRINGING, z0), (outer, top, z1)), _STONE)
        for z0, z1 in ((-_END_Z, _COLUMNS_Z[0]), (_COLUMNS_Z[-1], _END_Z))
    ]


def _cornice() -> Part:
    """Return the mouldings along the nave: below the gallery and below the vault."""
    profile = np.array([(0.30, -0.34), (0.36, -0.30), (0.36, -0.22), (0.42, -0.16), (0.50, -0.12), (0.50, 0.0)])
    along = np.array([0.0, 0.0, _END_Z])
    strips = []
    for height in (_GALLERY, _VAULT + 0.02):
        line = np.stack([_ROW_X - profile[:, 0], height + profile[:, 1], np.zeros(len(profile))], axis=1)
        ends = np.stack([line - along, line + along], axis=1)
        strips.append(grid(ends))
        x0, x1 = _ROW_X - 0.5, _ROW_X + 0.3
        strips.append(box((x0, height, -_END_Z), (x1, height + 0.05, _END_Z)))
    return joined(strips)


def _gallery() -> list[Part]:
    """Return floor, railing, colonnettes and architrave of the upper storey."""
    foot = rounded([(0.16, 6.45), (0.17, 6.50), (0.17, 6.56), (0.12, 6.64)], 3)
    shaft = [(0.115, 6.9), (0.115, 7.4), (0.11, 8.0), (0.10, 8.6), (0.095, 8.8)]
    head = rounded([(0.12, 8.82), (0.12, 8.86), (0.10, 8.90), (0.14, 9.02), (0.18, 9.08)], 3)
    colonnette = lathe(np.concatenate([foot, shaft, head]), 32)
    colonnette = complete(of_material(joined([colonnette, box((-0.2, 9.08, -0.2), (0.2, 9.2, 0.2))]), _MARBLE))
    places = np.concatenate([_COLUMNS_Z, _COLUMNS_Z[:-1] + 0.5 * _BAY])
    return [
        of_material(box((_ROW_X - 0.3, _GALLERY - 0.3, -_END_Z), (_OUTER_X, _GALLERY, _END_Z)), _STONE),
        of_material(box((_ROW_X - 0.3, 9.2, -_END_Z), (_ROW_X + 0.3, _VAULT - 0.3, _END_Z)), _STONE),
        of_material(box((_ROW_X - 0.3, _VAULT - 0.3, -_END_Z), (_OUTER_X, _VAULT, _END_Z)), _STONE),
        *[moved(colonnette, _ROW_X, 0.0, z) for z in places],
        of_material(railing(_ROW_X - 0.22, _GALLERY + 0.05, 1.0, -_END_Z, _END_Z), _IRON),
    ]


def _spandrel_cloth() -> list[Part]:
    """Return the banners over the columns; they hang before the arcade, into the nave."""
    colors = (_RED, _GOLD, _BLUE, _GREEN)
    return [
        of_material(moved(turned(banner(0.95, 2.3, 0.9 * i), -0.5 * np.pi), _ROW_X - 0.62, 6.3, z), colors[i % 4])
        for i, z in enumerate(_COLUMNS_Z)
        if i % 2 == 0
    ]


def _floor() -> list[Part]:
    """Return tiles of two tints that vary a little, and a carpet up to the steps."""
    size = 0.75
    columns, rows = round(2 * (_OUTER_X + 0.75) / size), round(2 * _END_Z / size)
    row, column = np.divmod(np.arange(rows * columns), columns)
    x, z = -_OUTER_X - 0.75 + column * size, -_END_Z + row * size
    low = np.stack([x, np.zeros_like(x), z], axis=1)
    offsets = size * np.array([[0, 0, 0], [0, 0, 1], [1, 0, 1], [1, 0, 0]], dtype=np.float64)
    positions = (low[:, None, :] + offsets).reshape(-1, 3)
    first = 4 * np.arange(len(low))[:, None]
    triangles = (first[:, None, :] + np.array([[0, 1, 2], [0, 2, 3]])[None, :, :]).reshape(-1, 3)
    # A hash of the tile's place serves as a random shade that is the same everywhere.
    shade = 0.88 + 0.12 * ((column * 73 + row * 151 + (column * row) % 17 * 31) % 97) / 96.0
    dark = (column + row) % 2 == 1
    tint = np.where(dark[:, None], [0.42, 0.33, 0.30], [1.0, 1.0, 1.0]) * shade[:, None]
    tiles = of_material(shapes.mesh(positions, triangles, name="floor"), _FLOOR)
    tiles = replace(tiles, colors=np.repeat(tint, 4, axis=0))
    u = np.linspace(-0.9, 0.9, 13)[None, :]
    v = np.linspace(-9.7, 13.8, 95)[:, None]
    ripple = 0.018 + 0.006 * np.sin(5.0 * v + 2.0 * u) * np.sin(1.7 * v)
    carpet = np.stack([u + 0.0 * v, ripple + 0.0 * u, v + 0.0 * u], axis=-1)
    cloth = grid(carpet[::-1])
    across = cloth.positions[cloth.triangles, 0].mean(axis=1)
    border = np.where(np.abs(across) > 0.75, _GOLD, _RED)
    return [tiles, replace(cloth, material_ids=border)]


def _walls() -> list[Part]:
    """Return the closed side, the pillars and railings of the open one, and the entrance wall."""
    x, z, top = _OUTER_X, _END_Z, _VAULT
    closed_side = shapes.quad([(-x, 0, z), (-x, 0, -z), (-x, top, -z), (-x, top, z)])
    entrance = shapes.quad([(x, 0, z), (-x, 0, z), (-x, top, z), (x, top, z)])
    parts = shapes.of_materials(([closed_side, entrance], _PLASTER))
    pilaster = of_material(box((-x, 0.0, -0.3), (-x + 0.18, _GALLERY - 0.3, 0.3)), _STONE)
    for place in _COLUMNS_Z:
        parts.append(moved(pilaster, 0.0, 0.0, place))
        parts.append(of_material(box((x - 0.3, 0, place - 0.3), (x + 0.3, top, place + 0.3)), _STONE))
    parts.append(of_material(railing(x, 0.0, 1.1, -z, z), _IRON))
    parts.append(of_material(railing(x, _GALLERY, 1.0, -z, z), _IRON))
    hung = (_GREEN, _BLUE, _RED, _GOLD)
    for i, place in enumerate(_COLUMNS_Z[:-1] + 0.5 * _BAY):
        cloth = moved(turned(banner(1.5, 3.6, 1.7 * i), 0.5 * np.pi), -x + 0.22, 5.2, place)
        parts.append(of_material(cloth, hung[i % 4]))
    return parts


def _vault() -> list[Part]:
    """Return the barrel vault with its ribs and its outer shell, which keeps the sun out."""
    angle = np.linspace(0.0, np.pi, 65)
    radius = _ROW_X + 0.3
    z = np.linspace(-_END_Z, _END_Z, 61)
    arc = np.stack([radius * np.cos(angle), _VAULT + radius * np.sin(angle)], axis=1)
    shell = np.stack(np.broadcast_arrays(arc[:, 0], arc[:, 1], z[:, None]), axis=-1)
    parts = [of_material(grid(shell[::-1]), _PLASTER)]
    rib = tube(np.stack([arc[:, 0], arc[:, 1], np.zeros(len(angle))], axis=1), (0.0, 0.0, 1.0), 0.14, 16)
    rib = complete(of_material(rib, _STONE))
    parts += [moved(rib, 0.0, 0.0, place) for place in _COLUMNS_Z]
    for turn in np.linspace(0.0, np.pi, 9)[1:-1]:
        x, y = radius * np.cos(turn), _VAULT + radius * np.sin(turn)
        path = np.array([(x, y, -_END_Z), (x, y, _END_Z)])
        parts.append(of_material(tube(path, (np.cos(turn), np.sin(turn), 0.0), 0.06, 10), _STONE))
    axis = np.array([0.0, _VAULT, 0.0])
    thickened = axis + (shell - axis) * [1.1, 1.1, 1.0]
    parts.append(of_material(grid(thickened), _STONE))
    lunette = np.stack([arc[:, 0], arc[:, 1], np.full(len(angle), _END_Z)], axis=1)
    base = lunette * [1.0, 0.0, 1.0] + [0.0, _VAULT, 0.0]
    parts.append(of_material(grid(np.stack([base, lunette])), _PLASTER))
    return parts


def _apse() -> list[Part]:
    """Return the half round end with its half dome, the wall round it, and the steps before it."""
    radius, top = _ROW_X - 0.4, 8.0
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 65)
    rise = np.linspace(0.0, 0.5 * np.pi, 33)
    ring = np.concatenate([np.full(2, radius), radius * np.cos(rise[1:])])
    height = np.concatenate([[0.0, top], top + radius * np.sin(rise[1:])])
    niche = np.stack(
        [ring[:, None] * np.sin(turn), height[:, None] + 0.0 * turn, -_END_Z - ring[:, None] * np.cos(turn)], axis=-1
    )
    arc = np.linspace(0.0, np.pi, 65)
    inner = np.stack([radius * np.cos(arc), top + radius * np.sin(arc)], axis=1)
    inner = np.concatenate([[(radius, 0.0)], inner, [(-radius, 0.0)]])
    ceiling = _VAULT + _ROW_X + 0.4
    outer = np.clip(inner * [9.0, 1.0], [-_OUTER_X, 0.0], [_OUTER_X, 0.0])
    outer[:, 1] = np.where(np.abs(inner[:, 0]) > 0.98 * radius, inner[:, 1], ceiling)
    front = [np.column_stack([line, np.full(len(line), -_END_Z)]) for line in (inner, outer)]
    behind = np.array([0.0, 0.0, -_END_Z])
    parts = [
        of_material(grid(niche), _PLASTER),
        of_material(grid((behind + (niche - behind) * [1.1, 1.06, 1.1])[::-1]), _STONE),
        of_material(grid(np.stack(front)[:, ::-1]), _PLASTER),
        of_material(tube(np.column_stack([inner, np.full(len(inner), -_END_Z)]), (0, 0, 1), 0.12, 16), _GOLD),
    ]
    for step in range(6):
        depth, half = 0.36 * step, _ROW_X - 0.55 - 0.12 * step
        block = box((-half, 0.16 * step, -_END_Z - radius), (half, 0.16 * (step + 1), -10.0 - depth))
        parts.append(of_material(block, _MARBLE))
    return parts


def _things() -> list[Part]:
    """Return a sphere before the apse, and vases, rings and spheres on pedestals."""
    outline = [
        (0.0, 0.0), (0.16, 0.0), (0.17, 0.03), (0.10, 0.08), (0.12, 0.14), (0.27, 0.34), (0.31, 0.52), (0.24, 0.72),
        (0.13, 0.82), (0.13, 0.88), (0.20, 0.96), (0.19, 0.96), (0.11, 0.88), (0.11, 0.80),
    ]  # fmt: skip
    vase = lathe(rounded(outline, 4), 64)
    sphere = shapes.ball(1.0, 80)
    torus = tube(0.3 * shapes.circle(64) + [0.0, 0.40, 0.0], (0.0, 0.0, 1.0), 0.1, 32)
    pedestal = joined([
        box((-0.34, 0.0, -0.34), (0.34, 0.10, 0.34)),
        lathe(rounded([(0.30, 0.10), (0.31, 0.15), (0.24, 0.2), (0.2, 0.5), (0.24, 0.82)], 4), 48),
        box((-0.30, 0.82, -0.30), (0.30, 0.92, 0.30)),
    ])  # fmt: skip
    small = replace(sphere, positions=0.34 * sphere.positions + [0.0, 0.34, 0.0])
    kinds = [of_material(vase, _TERRACOTTA), of_material(small, _BRONZE), of_material(torus, _MARBLE)]
    kinds = [complete(joined([of_material(pedestal, _STONE), moved(kind, 0, 0.92, 0)])) for kind in kinds]
    parts = []
    for i, z in enumerate((9.0, 3.0, -3.0)):
        parts.append(moved(kinds[i], -2.3, 0.0, z))
        parts.append(moved(kinds[(i + 1) % 3], 2.3, 0.0, z - 1.5))
    great = replace(sphere, positions=0.8 * sphere.positions + [0.0, 0.96 + 0.8, -13.4])
    parts.append(of_material(great, _BRONZE))
    return parts
