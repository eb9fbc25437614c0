"""Frames as text, as Markdown and JSON, and as picture strips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.bench.pictures import error_colors
from ssgi_cl.device.arrays import Size
from ssgi_cl.io import png
from ssgi_cl.techniques.filters.tonemap import auto_exposure

from .ablation import Replaced
from .error import FrameError, encoded
from .measure import Row
from .verdict import PEER, verdict

Floats = NDArray[np.float32]

FORMAT = "ssgi-frame 1"

HEADINGS = ("frame", "first ms", "kept ms", "FLIP", "rel. MSE", "bias")
ABLATION_HEADINGS = ("replaced by its truth", "light", "FLIP", "rel. MSE", "FLIP if it alone is "
                     "ours", "rel. MSE")  # fmt: skip


@dataclass
class SceneResult:
    """What was measured on a scene.

    Attributes:
        scene: its name.
        size: rows and columns.
        noise: mean standard error of the reference over its mean.
        rows: the frames.
        skipped: why others are missing.
        ablations: mode -> terms.
    """

    scene: str
    size: Size
    noise: float
    rows: list[Row]
    skipped: list[str]
    ablations: dict[str, list[Replaced]] = field(default_factory=dict)


def markdown(found: Sequence[SceneResult], stamp: str) -> str:
    """Return tables of all scenes, and a verdict of each."""
    lines = [stamp, ""]
    for scene in found:
        rows, columns = scene.size
        lines += [
            f"## {scene.scene}, {columns} x {rows}",
            "",
            f"Standard error of the reference: {100 * scene.noise:.1f} % of its mean.",
            "",
        ]
        if scene.rows:
            lines += _table(HEADINGS, [_cells(row) for row in scene.rows])
            lines += [f"**{verdict(scene.rows).text}**", ""]
        for name, terms in scene.ablations.items():
            lines += [f"Terms of `{name}`:", ""]
            lines += _table(ABLATION_HEADINGS, [_ablation_cells(term) for term in terms])
        lines += [f"Skipped {reason}" for reason in scene.skipped]
        lines += [""] * bool(scene.skipped)
    return "\n".join(lines)


def document(found: Sequence[SceneResult], about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the same as JSON can hold it, without pictures."""
    return {**about, "format": FORMAT, "scenes": [
        {
            "scene": scene.scene, "size": list(scene.size), "reference_noise": scene.noise,
            "frames": [
                {"name": row.name, "own": row.own, "first_ms": row.first_ms,
                 "kept_ms": row.kept_ms, **row.error._asdict()}
                for row in scene.rows
            ],
            "goal": verdict(scene.rows).reached,
            "verdict": verdict(scene.rows).text,
            "skipped": scene.skipped,
            "ablation": {
                name: [
                    {"term": term.term, "share": term.share, "alone": term.alone._asdict(),
                     "kept": term.kept and term.kept._asdict()}
                    for term in terms
                ]
                for name, terms in scene.ablations.items()
            },
        }
        for scene in found
    ]}  # fmt: skip


def write_strips(folder: Path, scene: str, rows: Sequence[Row], expected: Floats) -> list[Path]:
    """Write a PNG for each of our frames: it, reference, its error, `PEER`, the peer's error.

    All with the reference's exposure; errors are blue where too dark, orange where too bright.
    """
    exposure = auto_exposure(expected)
    seen = np.ones(expected.shape[:2], np.bool_)
    peer = next((row for row in rows if row.name == PEER), None)
    written = []
    for row in rows:
        if not row.own:
            continue
        parts = [_bytes(row.radiance, exposure), _bytes(expected, exposure),
                 error_colors(row.radiance, expected, seen)]  # fmt: skip
        if peer is not None:
            parts += [_bytes(peer.radiance, exposure), error_colors(peer.radiance, expected, seen)]
        path = folder / f"frame-{scene}-{row.name}.png"
        png.write(path, np.concatenate(parts, axis=1))
        written.append(path)
    return written


def _bytes(radiance: Floats, exposure: float) -> NDArray[np.uint8]:
    return np.rint(255.0 * encoded(radiance, exposure)).astype(np.uint8)


def _cells(row: Row) -> list[str]:
    return [row.name, f"{row.first_ms:.0f}", f"{row.kept_ms:.0f}", *_errors(row.error),
            f"{100 * row.error.bias:+.1f} %"]  # fmt: skip


def _ablation_cells(term: Replaced) -> list[str]:
    kept = ["", ""] if term.kept is None else _errors(term.kept)
    return [term.term, f"{100 * term.share:.1f} %", *_errors(term.alone), *kept]


def _errors(error: FrameError) -> list[str]:
    return [f"{error.flip:.3f}", f"{error.mrse:.3g}"]


def _table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a Markdown table whose columns are aligned as text too."""
    widths = [max(len(row[i]) for row in [headings, *rows]) for i in range(len(headings))]

    def line(cells: Sequence[str]) -> str:
        first, *rest = (
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(cells, widths, strict=True))
        )
        return f"| {' | '.join([first, *rest])} |"

    rule = "|".join(["-" * (widths[0] + 2), *("-" * (w + 1) + ":" for w in widths[1:])])
    return [line(headings), f"|{rule}|", *map(line, rows), ""]
