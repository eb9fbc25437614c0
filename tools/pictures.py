"""The pictures of README and docs, but plots of figures: `python -m tools.pictures`.

Those of techniques (`tools/technique_pictures.py`) and of README (`tools/readme_picture.py`) are made anew and
written as small as is possible without loss. The gallery's are made with the site, plots by `make figures-render`.
"""

from __future__ import annotations

from pathlib import Path

from PIL import Image

from tools import readme_picture, technique_pictures

DOCS = Path(__file__).parents[1] / "docs"
KINDS = (".png", ".jpg", ".svg")
MOST_BYTES = 10_000_000
"""Of all pictures of docs together."""


def pictures(docs: Path) -> list[Path]:
    """Return the pictures that are kept in docs."""
    made = {"generated", "_build"}
    return sorted(p for p in docs.rglob("*") if p.suffix in KINDS and not made & set(p.relative_to(docs).parts))


def compress(path: Path) -> None:
    """Write a PNG file again, as small as is possible with the same pixels: no alpha or colour without need."""
    before = path.read_bytes()
    with Image.open(path) as image:
        image.load()
        opaque = image.convert("RGB") if image.mode == "RGBA" and image.getextrema()[3] == (255, 255) else image
        (opaque.convert("L") if opaque.mode == "RGB" and is_grey(opaque) else opaque).save(path, optimize=True)
    if path.stat().st_size >= len(before):
        path.write_bytes(before)


def compress_gallery(docs: Path) -> None:
    """Compress the pictures that scripts have just made, which are the ones with an alpha channel."""
    for path in (docs / "generated/gallery").rglob("*.png"):
        with Image.open(path) as image:
            fresh = image.mode == "RGBA"
        if fresh:
            compress(path)


def is_grey(image: Image.Image) -> bool:
    """Return whether the three channels of an image are the same."""
    red, green, blue = image.split()
    return red.tobytes() == green.tobytes() == blue.tobytes()


def main() -> None:
    """Make all, compress them, and say how large they are together."""
    technique_pictures.main([])
    readme_picture.main()
    for path in pictures(DOCS):
        if path.suffix == ".png":
            compress(path)
    total = sum(path.stat().st_size for path in pictures(DOCS))
    print(f"{len(pictures(DOCS))} pictures, {total / 1e6:.1f} MB of at most {MOST_BYTES / 1e6:.0f}")


if __name__ == "__main__":
    main()
