"""Material libraries of Wavefront OBJ: .mtl text to materials."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ssgi_cl.core.errors import SceneError, shown
from ssgi_cl.core.scene import Material
from ssgi_cl.core.srgb import mean_color
from ssgi_cl.rasterize.files.metal_rough import Lobe, metal_rough_lobe
from ssgi_cl.rasterize.files.mtl_notes import features_of
from ssgi_cl.rasterize.files.textures import TextureSet

# Options of a map statement and how many words follow each; -s, -o and -t take one to three.
_OPTION_WORDS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-mm": 2, "-texres": 1, "-clamp": 1, "-bm": 1,
    "-imfchan": 1, "-type": 1, "-cc": 1, "-colorspace": 1,
}  # fmt: skip
_VECTOR_OPTIONS = ("-s", "-o", "-t")


@dataclass(frozen=True, kw_only=True)
class MtlMaterial:
    """A material of a library and how it lays its texture.

    Attributes:
        material: albedo from Kd, emission from Ke and map_Ke, Phong lobe from Ks and Ns or from metal and roughness,
            opacity from d/Tr.
        features: what of it is not drawn as the file says.
        uv_scale, uv_offset: [2] each; the texture is looked up at scale * uv + offset.
    """

    material: Material
    features: tuple[str, ...] = ()
    uv_scale: tuple[float, float] = (1.0, 1.0)
    uv_offset: tuple[float, float] = (0.0, 0.0)


@dataclass
class _Map:
    name: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass
class _Entry:
    name: str
    numbers: dict[str, list[float]] = field(default_factory=dict)
    maps: dict[str, _Map] = field(default_factory=dict)
    others: dict[str, list[str]] = field(default_factory=dict)


def read_mtl(text: str, folder: Path, textures: TextureSet, *, within: Path) -> dict[str, MtlMaterial]:
    """Return the materials of a library by name.

    Kd and Ke are taken as linear, map_Kd as sRGB-encoded. A map_d (or an opacity below 1) makes
    the material cut out at one half: what is mostly transparent is a hole. Where Pm or Pr (or their
    textures) say metal and roughness, these give the lobe, as in glTF, in place of Ks and Ns. Textures
    of metal and roughness count with their mean.

    Args:
        text: contents of the .mtl file; words may be parted by spaces or tabs.
        folder: of the .mtl file; names of textures are relative to it.
        textures: gets the textures that are used.
        within: the folder that no texture may lie outside of.

    Raises:
        SceneError: a number can't be read, or a texture is damaged. One that is not found, or outside
            of `within`, is noted.
    """
    entries: dict[str, _Entry] = {}
    entry: _Entry | None = None
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").split("\n"):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        key = words[0].lower()
        if key == "newmtl":
            name = line.strip()[len("newmtl") :].strip()
            entry = entries.setdefault(name, _Entry(name))
        elif entry is None:
            continue
        elif key in ("kd", "ke", "ks", "ns", "d", "tr", "pm", "pr"):
            entry.numbers[key] = _numbers(key, words[1:], entry.name)
        elif key in ("map_kd", "map_d", "map_ke", "map_pm", "map_pr"):
            entry.maps[key] = _map(line.strip()[len(key) :].strip(), entry.name)
        else:
            entry.others[key] = words[1:]
    images: dict[str, NDArray[np.uint8] | None] = {}

    def image_of(entry: _Entry, key: str) -> NDArray[np.uint8] | None:
        if key not in entry.maps:
            return None
        name = entry.maps[key].name
        if name not in images:
            what = f"the {key} texture of material {shown(entry.name)}"
            images[name] = textures.read(folder, name, what, within=within)
        return images[name]

    result = {}
    for name, entry in entries.items():
        texture = -1
        color, opacity = image_of(entry, "map_kd"), image_of(entry, "map_d")
        if color is not None or opacity is not None:
            texture = textures.add(_join(color, opacity))
        glow = image_of(entry, "map_ke")
        metal, rough = (image_of(entry, key) for key in ("map_pm", "map_pr"))
        means = {
            "map_kd": np.ones(3) if color is None else mean_color(color),
            "map_pm": None if metal is None else _mean(metal),
            "map_pr": None if rough is None else _mean(rough),
        }
        glow_texture = -1 if glow is None else textures.add(glow)
        result[name] = _material(entry, texture, glow_texture, means)
    return result


def _numbers(key: str, words: list[str], material: str) -> list[float]:
    values = []
    for word in words:
        if word.startswith("#"):
            break
        if key == "d" and word.lower() == "-halo":
            continue
        values.append(_number(word))
    if not values or not all(map(math.isfinite, values)):
        raise SceneError(f"material {shown(material)}: {key} {shown(' '.join(words))}: expected finite numbers")
    return values


def _map(text: str, material: str) -> _Map:
    result = _Map("")
    words = text.split()
    place = 0
    while place < len(words) and words[place].lower() in (*_OPTION_WORDS, *_VECTOR_OPTIONS):
        option = words[place].lower()
        place += 1
        if option in _OPTION_WORDS:
            place += _OPTION_WORDS[option]
            continue
        values: list[float] = []
        while place < len(words) and len(values) < 3 and math.isfinite(_number(words[place])):
            values.append(float(words[place]))
            place += 1
        both = (values[0], values[1] if len(values) > 1 else values[0]) if values else (1.0, 1.0)
        if option == "-s":
            result.scale = both
        elif option == "-o":
            result.offset = ([*values, 0.0, 0.0][0], [*values, 0.0, 0.0][1])
    # A name may hold several blanks in a row, so it is cut from the text rather than joined.
    result.name = text.split(None, place)[place].strip() if place < len(words) else ""
    if not result.name:
        raise SceneError(f"material {shown(material)}: a map statement names no file: {shown(text)}")
    return result


def _number(word: str) -> float:
    """Return a word as a number, NaN if it is none."""
    try:
        return float(word)
    except ValueError:
        return math.nan


def _mean(image: NDArray[np.uint8]) -> float:
    """Return the mean in [0, 1] of a texture of one number, which is grey."""
    return float(image[..., 0].mean()) / 255.0


def _lobe(entry: _Entry, base: NDArray[np.float64], means: Mapping[str, Any]) -> Lobe:
    """Return what a material mirrors; `means` are those of its textures."""
    numbers = entry.numbers
    gloss = min(max(numbers.get("ns", [1.0])[0], 1.0), 1e6)
    metal, rough = means["map_pm"], means["map_pr"]
    if metal is None and rough is None and not {"pm", "pr"} & numbers.keys():
        return Lobe(specular=_clipped(_rgb(numbers.get("ks", [0.0]))), gloss=gloss)
    # Roughness that is not given is that of Ns, the exponent: see `rough_lobe`.
    otherwise = (2.0 / (gloss + 2.0)) ** 0.25 if "ns" in numbers else 1.0
    given = {
        key: numbers.get(key, [1.0 if mean is not None else least])[0] * (1.0 if mean is None else mean)
        for key, mean, least in (("pm", metal, 0.0), ("pr", rough, otherwise))
    }
    return metal_rough_lobe(base, given["pm"], given["pr"])


def _material(entry: _Entry, texture: int, glow: int, means: Mapping[str, Any]) -> MtlMaterial:
    """Return a material; `means` are those of its textures, None where there is none."""
    numbers = entry.numbers
    opacity = numbers["d"][0] if "d" in numbers else 1.0 - numbers.get("tr", [0.0])[0]
    opacity = min(max(opacity, 0.0), 1.0)
    white = (1.0, 1.0, 1.0)
    albedo = _rgb(numbers["kd"]) if "kd" in numbers else None
    color = _clipped(albedo or (white if texture >= 0 else Material.albedo))
    lobe = _lobe(entry, np.array(color) * means["map_kd"], means)
    emission = _rgb(numbers.get("ke", [0.0 if glow < 0 else 1.0]))
    laid = entry.maps.get("map_kd") or entry.maps.get("map_d") or entry.maps.get("map_ke") or _Map("")
    return MtlMaterial(
        material=Material(
            name=entry.name,
            albedo=_rgb([lobe.matt * value for value in color]),
            texture=texture,
            alpha=opacity,
            alpha_cutoff=0.5 if opacity < 1.0 or "map_d" in entry.maps else 0.0,
            blends=opacity < 1.0,
            emission=_clipped(emission, math.inf),
            emission_texture=glow,
            specular=lobe.specular,
            gloss=lobe.gloss,
        ),
        features=tuple(features_of(entry.numbers, entry.maps, entry.others)),
        uv_scale=laid.scale,
        uv_offset=laid.offset,
    )


def _join(color: NDArray[np.uint8] | None, opacity: NDArray[np.uint8] | None) -> NDArray[np.uint8]:
    """Return RGBA from map_Kd and map_d; without map_d the alpha of map_Kd is kept, unused."""
    if opacity is None:
        return np.full((1, 1, 4), 255, dtype=np.uint8) if color is None else color
    # The opacity is the alpha channel where the image has one, else its grey value.
    alpha = opacity[..., 3] if opacity[..., 3].min() < 255 else opacity[..., :3].max(axis=2)
    if color is None:
        color = np.full((*alpha.shape, 4), 255, dtype=np.uint8)
    if alpha.shape != color.shape[:2]:
        alpha = np.asarray(Image.fromarray(alpha).resize(color.shape[1::-1]))
    return np.concatenate([color[..., :3], alpha[..., None]], axis=2)


def _rgb(values: list[float]) -> tuple[float, float, float]:
    """Return three numbers; the format lets one stand for all three."""
    return (values[0], values[1], values[2]) if len(values) >= 3 else (values[0],) * 3


def _clipped(values: tuple[float, float, float], high: float = 1.0) -> tuple[float, float, float]:
    red, green, blue = (min(max(value, 0.0), high) for value in values)
    return red, green, blue
