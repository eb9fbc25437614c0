"""Links of Markdown pages, for the site: pages of other folders become pages of it, files are offered as they are."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path

OUTSIDE: Mapping[str, str] = {
    "ARCHITECTURE.md": "architecture",
    "CHANGELOG.md": "changelog",
    "CONTRIBUTING.md": "contributing",
    "kernels/README.md": "kernels",
}
"""Pages outside of docs, seen from the root of the checkout -> names in `PROJECT`."""

GALLERY = "docs/gallery/"

PROJECT = "generated/project"
"""Folder of their copies, seen from docs."""

_LINK = re.compile(r"(?<!`)(!?)\[([^\]]*)\]\(([^)\s]+)\)")
_FENCE = re.compile(r"(^```.*?^```)", re.DOTALL | re.MULTILINE)


def resolved(text: str, page: Path, root: Path) -> str:
    """Return a page with its links turned to what the site has.

    Args:
        text: of the page.
        page: its path from the root of the checkout.
        root: of the checkout.
    """

    def one(match: re.Match[str]) -> str:
        mark, label, link = match.groups()
        path, hash_, anchor = link.partition("#")
        if "://" in link or not path or path.startswith("mailto:"):
            return match[0]
        target = os.path.normpath(page.parent / path)
        if target == "README.md":
            return f"[{label}](/index.md)"
        if target in OUTSIDE:
            return f"{mark}[{label}](/{PROJECT}/{OUTSIDE[target]}.md{hash_}{anchor})"
        if target.startswith(GALLERY):
            return f"[{label}](/generated/gallery/{gallery_page(target.removeprefix(GALLERY))})"
        if target.startswith("docs/") and (root / target).is_file():
            return f"{mark}[{label}](/{target.removeprefix('docs/')}{hash_}{anchor})"
        if (root / target).is_file():
            up = os.path.relpath(root / target, root / "docs" / PROJECT)
            return f"[{label}]({up})" if page.as_posix() in OUTSIDE else match[0]
        return f"{label}"  # a folder: the site has none

    return "".join(part if part.startswith("```") else _LINK.sub(one, part) for part in _FENCE.split(text))


def gallery_page(script: str) -> str:
    """Return the page of a script, or of a folder's README.rst, seen from the folder of built pages."""
    return script.replace("README.rst", "index.rst").removesuffix(".py").removesuffix(".rst") + ".rst"


def remove_stale(root: Path, docs: Path) -> None:
    """Remove what was made of scripts of the gallery that are no more."""
    built = docs / "generated/gallery"
    for page in built.rglob("*.rst"):
        script = root / GALLERY / page.relative_to(built).with_suffix(".py")
        if page.name != "index.rst" and not script.exists():
            for path in page.parent.glob(f"{page.stem}.*"):
                path.unlink()


def write_project(root: Path, docs: Path) -> None:
    """Write the pages outside of docs into `PROJECT`, links resolved."""
    folder = docs / PROJECT
    folder.mkdir(parents=True, exist_ok=True)
    for source, name in OUTSIDE.items():
        if (root / source).is_file():
            text = resolved((root / source).read_text(encoding="utf-8"), Path(source), root)
            path = folder / f"{name}.md"
            if not path.exists() or path.read_text(encoding="utf-8") != text:
                path.write_text(text, encoding="utf-8")
