"""Notes on a material of an .mtl file: what of it is not drawn, or drawn in another way."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence

_MAPS = {
    "bumps ({}) are not drawn": ("map_bump", "bump", "norm", "map_norm", "map_normal"),
    "displacement ({}) is not drawn": ("disp", "map_disp"),
    "a reflection map ({}) is not drawn": ("refl", "map_refl"),
    "a decal ({}) is not drawn": ("decal",),
    "a texture of reflectance ({}) is not used": ("map_ks",),
    "a texture of gloss ({}) is not used": ("map_ns",),
    "a texture of transparency ({}) is not used, other than map_d": ("map_tr",),
    "a texture of sheen ({}) is not drawn": ("map_ps",),
}
_MEANS = {
    "map_pm": "a texture of metal (map_Pm) counts with its mean",
    "map_pr": "a texture of roughness (map_Pr) counts with its mean",
}
_FACTORS = {
    "ps": "sheen (Ps) is not drawn",
    "pc": "a clear coat (Pc) is not drawn",
    "aniso": "anisotropy (aniso) is not drawn",
}
_SPELT = {"map_bump": "map_Bump", "map_ks": "map_Ks", "map_ns": "map_Ns", "map_tr": "map_Tr", "map_ps": "map_Ps"}
_GLASS = ("4", "6", "7", "9")


def features_of(
    numbers: Mapping[str, Sequence[float]], maps: Container[str], others: Mapping[str, Sequence[str]]
) -> Iterator[str]:
    """Yield the features of a material that are not drawn as the file says.

    Args:
        numbers, maps: statements that are read, in lower case.
        others: those that are not, with their words.
    """
    yield from (text for key, text in _MEANS.items() if key in maps)
    for text, keys in _MAPS.items():
        if found := [_SPELT.get(key, key) for key in keys if key in others]:
            yield text.format(", ".join(found))
    yield from (text for key, text in _FACTORS.items() if any(map(_number, others.get(key, ())[:1])))
    kind = (*others.get("illum", ()), "")[0]
    # 1 1 1 is what programs write for what is opaque.
    if "tf" in others and (kind in _GLASS or any(_number(word) != 1.0 for word in _plain(others["tf"]))):
        yield "a filter of what shines through (Tf) is not used"
    if kind == "0":
        yield "it is lit, though illum 0 says that it is not"
    elif kind == "1" and any(numbers.get("ks", ())):
        yield "its highlight (Ks) is drawn, though illum 1 says that it has none"
    elif kind in _GLASS:
        yield f"light is not bent by it as glass (illum {kind}) does"
    elif kind in ("3", "5", "8"):
        yield f"mirror images (illum {kind}) are as sharp as Ns says"


def _plain(words: Sequence[str]) -> list[str]:
    """Return the words of a colour, up to a comment."""
    for place, word in enumerate(words):
        if word.startswith("#"):
            return list(words[:place])
    return list(words)


def _number(word: str) -> float:
    """Return a word as a number; 0 if it is none."""
    try:
        return float(word)
    except ValueError:
        return 0.0
