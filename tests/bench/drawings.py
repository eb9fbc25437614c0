"""Contents of an SVG of matplotlib."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET


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
