"""The page of Markdown and its plots."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

from ssgi_cl.bench import front, summary

from .documents import entry, whole


def test_every_case_has_a_row_and_every_group_with_errors_a_plot_that_is_linked(
    tmp_path: Path,
) -> None:
    results = [
        entry("ssao.4.hall.8x6", 1.0, 0.2), entry("embree.16.hall.8x6", 9.0, 0.05),
        entry("gbuffer.1.hall.8x6", 3.0, None, quantity="", errors={}),
    ]
    front.mark(results)
    files = summary.write(tmp_path / "page.md", whole(*results))
    assert [file.name for file in files] == ["page.md", "page-occlusion-hall-8x6.svg"]
    text = files[0].read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("| ") and "case" not in line]
    assert len(rows) == 3
    assert re.search(r"\| \\\* \| ssao\.4 \| 1\.00 \|", text)
    assert "](page-occlusion-hall-8x6.svg)" in text
    assert "Rays against the mesh" in text


def test_a_plot_is_a_whole_svg_of_its_own_with_a_legend(tmp_path: Path) -> None:
    results = [entry("ssao.4.hall.8x6", 1.0, 0.2), entry("embree.16.hall.8x6", 9.0, 0.05)]
    _, drawing = summary.write(tmp_path / "page.md", whole(*results))
    root = ET.fromstring(drawing.read_text(encoding="utf-8"))
    texts = ["".join(element.itertext()) for element in root.iter() if element.tag.endswith("text")]
    assert {"ssao", "embree"} <= set(texts)
    assert any(element.tag.endswith("style") for element in root.iter())


def test_what_was_skipped_is_listed_and_an_empty_document_is_a_page_too(tmp_path: Path) -> None:
    skipped = [{"name": "vtk-ssao.64.hall.8x6", "reason": "vtk is not installed"}]
    (page,) = summary.write(tmp_path / "page.md", whole(skipped=skipped))
    assert "- vtk-ssao.64.hall.8x6: vtk is not installed" in page.read_text(encoding="utf-8")
