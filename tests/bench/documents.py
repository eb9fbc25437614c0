"""Documents as a benchmark would write them and little scenes, made up, and contents of an SVG of matplotlib."""

from __future__ import annotations

import io
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from typing import Any

from rich.console import Console

from ssgi_cl.rasterize.parts import assemble
from ssgi_cl.rasterize.scenes import BuiltinScene
from ssgi_cl.rasterize.scenes.shapes import box, moved


def spread(median: float, share: float = 0.02) -> dict[str, float]:
    """Return a median with quartiles at `share` of it on both sides."""
    return {"median": median, "low": median * (1.0 - share), "high": median * (1.0 + share)}


def entry(name: str = "ssao.16.hall.8x6", ms: float = 2.0, rmse: float | None = 0.05, **changes: Any) -> dict[str, Any]:
    """Return a result with an error against the world, as far as `changes` don't say otherwise."""
    family, setting, scene, size = name.split(".")
    columns, rows = size.split("x")
    regions = {
        "creases": {"share": 0.25, "rmse": 2.0 * (rmse or 0.0), "bias": 0.0},
        "elsewhere": {"share": 0.75, "rmse": rmse, "bias": 0.0},
    }
    return {
        "name": name,
        "family": family,
        "setting": setting,
        "scene": scene,
        "size": [int(rows), int(columns)],
        "quantity": "occlusion",
        "note": "",
        "wall_ms": spread(ms),
        "device_ms": spread(0.8 * ms),
        "runs": 30,
        "ratio": spread(ms / 2),
        "unsteady": "",
        "samples_g_s": 2.0,
        "moved_gb_s": 3.1,
        "passes": [{"name": "ssao", "ms": ms}],
        "errors": {
            "world": {
                "rmse": rmse,
                "bias": -0.01,
                "p99": 0.2,
                "psnr": None,
                "mrse": 0.01,
                "ssim": 0.9,
                "flip": None,
                "truth_error": 0.0,
                "regions": regions,
            }
        },
        "counted": "",
        "front": False,
        "near": False,
        **changes,
    }


def whole(*results: dict[str, Any], **changes: Any) -> dict[str, Any]:
    """Return a document with these results."""
    return {
        "format": "ssgi-bench 2",
        "created": "2024-05-06T07:08:09+00:00",
        "options": {"truth_rays": 512, "attenuation": "none", "seconds": 1.0},
        "versions": {"ssgi_cl": "0.1.0", "numpy": "2.0", "vtk": None},
        "revision": "abc1234",
        "modified": False,
        "device": {"label": "Made up 1.0: CPU", "kind": "cpu", "units": 2, "variant": "16 lanes"},
        "machine": {"cpu": "Made up", "threads": 2, "system": "None"},
        "calibration": {"bandwidth_gb_s": 31.0, "gathers_g_s": 4.0, "multiply_adds_gflop_s": 230.0},
        "reference": {"name": "gathers", "ms": 2.0},
        "results": list(results),
        "skipped": [],
        **changes,
    }


def boxes(name: str, high: float, *others: tuple[float, float, float]) -> BuiltinScene:
    """Return a scene of a box on a floor and others like it: x, z and height of each."""
    parts = [box((-2.0, -0.1, -2.0), (2.0, 0.0, 2.0))]
    parts += [moved(box((-0.3, 0.0, -0.3), (0.3, tall, 0.3)), x, 0.0, z) for x, z, tall in ((0.0, 0.0, high), *others)]
    return BuiltinScene(
        name=name, scene=assemble(parts, (), (), crease_angle=0.5), eye=(1.6, 1.4, 2.2), target=(0.0, 0.2, 0.2),
        yfov=0.8, lights=(), ao_radius=0.4,
    )  # fmt: skip


def printed(show: Callable[[Any, Console], object], found: Any, width: int = 120) -> str:
    """Return what is written to a terminal of a width."""
    console = Console(file=(file := io.StringIO()), width=width)
    show(found, console)
    return file.getvalue()


def marked(root: ET.Element, name: str) -> list[ET.Element]:
    """Return the elements with this id."""
    return [element for element in root.iter() if element.get("id") == name]


def path_points(element: ET.Element) -> list[tuple[float, float]]:
    """Return the corners of the first path in an element, if there is one."""
    drawn = next((e.get("d", "") for e in element.iter() if e.tag.endswith("path")), "")
    return [(float(x), float(y)) for x, y in re.findall(r"[ML] (\S+) (\S+)", drawn)]


def texts(root: ET.Element) -> list[str]:
    """Return what is written, the title of the file too."""
    return ["".join(e.itertext()) for e in root.iter() if e.tag.rpartition("}")[2] in ("text", "title")]
