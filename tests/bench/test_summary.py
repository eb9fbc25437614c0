"""Results as tables in the terminal, and as a page of Markdown with plots, error maps and exposure."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ssgi_cl.bench import summary, table, wording
from ssgi_cl.bench.suite import Pictures
from ssgi_cl.bench.verdict import mark

from .documents import entry, printed, texts, whole


def shown(document: dict[str, Any], width: int = 120) -> list[str]:
    return printed(table.show, document, width).splitlines()


def line_of(lines: list[str], name: str) -> str:
    return next(line for line in lines if name in line)


FULL = whole(
    entry("embree-blur.16.hall.800x600", 1234.0, 0.0255, device_ms=None),
    entry("ssao.16.hall.800x600", 6.0, 0.0821, front=True, unsteady="it [jumps]"),
    entry("shade.sun.hall.800x600", 5.6, 1.5, quantity="direct"),
    entry("gbuffer.full.hall.800x600", 26.0, quantity="", errors={}),
    skipped=[{"name": "vtk-ssao.64.hall.800x600", "reason": "pip install 'ssgi-cl[peers]'"}],
)


def test_table_shows_time_rate_error_and_marks() -> None:
    lines = shown(FULL)
    text = "\n".join(lines)
    assert "ceilings: memory 31.0 GB/s, scattered reads 4.00 G/s" in text
    figures = "* ssao.16 6.00~ 5.88..6.12 4.80 3.00 2.00 3.10 50 % reads 0.0821 -0.0100 0.0100"
    assert line_of(lines, "ssao.16").split() == figures.split()
    # Nothing by the device's clock, and no share of its ceilings.
    assert line_of(lines, "embree-blur.16").split()[:2] == ["embree-blur.16", "1234"]
    assert "%" not in line_of(lines, "embree-blur.16")
    assert text.index("ssao.16") < text.index("embree-blur.16")  # the fastest first
    assert "~ ssao.16.hall.800x600: it [jumps]" in text
    assert "skipped vtk-ssao.64.hall.800x600: pip install 'ssgi-cl[peers]'" in text
    assert "Direct light, hall, 800 x 600, errors in W/m²" in text


@pytest.mark.parametrize("width", [40, 60, 80, 100, 140])
def test_table_fits_and_keeps_case_time_and_error(width: int) -> None:
    lines = shown(FULL, width)
    assert max(len(line) for line in lines) <= width
    line = line_of(lines, " embree-blur.16")
    assert "1234" in line
    assert "0.0255" in line


def test_a_wide_console_has_all_columns() -> None:
    result = entry("embree-blur.16.hall.800x600")
    result["errors"]["assumption"] = {"rmse": 0.0123}
    line = line_of(shown(whole(result)), "embree-blur.16")
    assert "0.0123" in line
    assert "1.96..2.04" in line


@pytest.mark.parametrize("skipped", [[], [{"name": "a.1.hall.8x6", "reason": "no [b]"}]])
def test_nothing_measured_says_so(skipped: list[dict[str, str]]) -> None:
    lines = shown(whole(skipped=skipped))
    assert "nothing was measured" in lines
    assert ("skipped a.1.hall.8x6: no [b]" in lines) == bool(skipped)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "-"),
        (float("nan"), "-"),
        (float("inf"), "-"),
        (0.0, "0"),
        (0.08214, "0.0821"),
        (9.996, "10.0"),
        (99.96, "100"),
        (5.0, "5.00"),
        (1234.4, "1234"),
        (-0.5, "-0.500"),
        (0.000123, "1.2e-04"),
        (1234567.0, "1.2e+06"),
        (0.001, "0.00100"),
    ],
)
def test_numbers_have_three_digits(value: float | None, text: str) -> None:
    assert wording.number(value) == text


def test_ceilings_of_zero_are_not_divided_by() -> None:
    none = {"bandwidth_gb_s": 0.0, "gathers_g_s": 0.0, "multiply_adds_gflop_s": 0.0}
    assert wording.ceiling(entry(), none) == (0.0, "")
    assert wording.ceiling(entry(), {**none, "gathers_g_s": 4.0}) == (0.5, "reads")


pytest.importorskip("matplotlib", reason="matplotlib is not installed (extra 'plots')")


def test_every_case_has_a_row_and_every_group_with_errors_a_plot_that_is_linked(tmp_path: Path) -> None:
    results = [
        entry("ssao.4.hall.8x6", 1.0, 0.2),
        entry("embree.16.hall.8x6", 9.0, 0.05),
        entry("gbuffer.1.hall.8x6", 3.0, None, quantity="", errors={}),
    ]
    mark(results)
    files = summary.write(tmp_path / "page.md", whole(*results), {})
    assert [file.name for file in files] == ["page.md", "page-occlusion-hall-8x6.svg"]
    assert {"ssao", "embree"} <= set(texts(ET.fromstring(files[1].read_text(encoding="utf-8"))))  # its legend
    text = files[0].read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.endswith(" |") and ".." in line]
    assert len(rows) == 3
    assert re.search(r"\| \\\* \| ssao\.4 \| 1\.00 \| 0\.980\.\.1\.02 \| 0\.800 \|", text)
    assert "](page-occlusion-hall-8x6.svg)" in text
    assert "Ceilings: memory 31.0 GB/s" in text
    assert "rays against the mesh" in text
    assert text.index("## The least error within a time") < text.index("## Ambient occlusion")


def test_tables_of_frames_have_a_mottling_in_place_of_a_model(tmp_path: Path) -> None:
    frame = entry("frame.default.hall.8x6", quantity="radiance")
    frame["errors"]["world"]["mottling"] = 0.0471
    assert "0.0471" in line_of(shown(whole(frame)), "frame.default")
    text = summary.write(tmp_path / "page.md", whole(frame, entry()), {})[0].read_text(encoding="utf-8")
    heads = [line for line in text.splitlines() if "| case |" in line]
    assert sorted("FLIP | mottling | counted" in head for head in heads) == [False, True]
    assert sorted("FLIP | RMSE of the model | its bias | counted" in head for head in heads) == [False, True]
    assert re.search(r"frame\.default .*\| 0\.0471 \|", text)


def test_tables_have_streaks_where_they_were_measured(tmp_path: Path) -> None:
    striped = entry()
    striped["errors"]["world"]["streaks"] = 0.0123
    assert "0.0123" in line_of(shown(whole(striped), 200), wording.short_name(striped))
    pages = [
        summary.write(tmp_path / f"{number}.md", whole(each), {})[0].read_text(encoding="utf-8")
        for number, each in enumerate((entry(), striped))
    ]
    heads = [next(line for line in text.splitlines() if "| case |" in line) for text in pages]
    assert ["streaks" in head for head in heads] == [False, True]
    assert "| 0.0123 |" in pages[1]


def test_the_best_of_ours_on_the_front_is_shown_beside_truth_and_error(tmp_path: Path) -> None:
    results = [
        entry("ssao.4.hall.8x6", 1.0, 0.2),
        entry("ssao.16.hall.8x6", 2.0, 0.1),
        entry("ssao.64.hall.8x6", 3.0, 0.3),
        entry("embree.16.hall.8x6", 9.0, 0.05),
    ]
    mark(results)
    half = np.full((6, 8), 0.5, np.float32)
    images = {
        result["name"]: Pictures(half + shift, half, None, np.ones((6, 8), np.bool_))
        for result, shift in zip(results, (0.1, 0.25, 0.2, 0.0), strict=True)
    }
    page, _, strip = summary.write(tmp_path / "page.md", whole(*results), images)
    assert "*ssao.16; reference; error" in page.read_text(encoding="utf-8")
    shown = np.asarray(Image.open(strip).convert("RGB")).astype(float)
    assert shown.shape == (6, 24, 3)
    # Shares without gamma: 0.75 and 0.5 of white, JPEG's rounding aside; the error is the
    # scale's upper end.
    np.testing.assert_allclose(shown[:, :7].mean(axis=(0, 1)), 191.0, atol=4.0)
    np.testing.assert_allclose(shown[:, 9:15].mean(axis=(0, 1)), 128.0, atol=4.0)
    np.testing.assert_allclose(shown[:, 17:].mean(axis=(0, 1)), (128, 48, 0), atol=24.0)


def test_wide_pictures_are_made_smaller_and_keep_their_shape(tmp_path: Path) -> None:
    results = [entry("ssao.4.hall.800x60", 1.0, 0.2)]
    mark(results)
    half = np.full((60, 800), 0.5, np.float32)
    images = {results[0]["name"]: Pictures(half, half, None, np.ones((60, 800), np.bool_))}
    strip = summary.write(tmp_path / "page.md", whole(*results), images)[-1]
    with Image.open(strip) as picture:
        assert picture.size == (1200, 30)


def test_what_was_skipped_is_listed_and_an_empty_document_is_a_page_too(tmp_path: Path) -> None:
    skipped = [{"name": "vtk-ssao.64.hall.8x6", "reason": "vtk is not installed"}]
    (page,) = summary.write(tmp_path / "page.md", whole(skipped=skipped), {})
    assert "The least error within a time" not in page.read_text(encoding="utf-8")
    assert "- vtk-ssao.64.hall.8x6: vtk is not installed" in page.read_text(encoding="utf-8")


def test_error_map_tells_dark_from_bright_and_greys_what_is_not_seen() -> None:
    truth = np.full((1, 4), 0.5, np.float32)
    result = np.array([[0.1, 0.5, 0.9, 0.9]], np.float32)
    colors = summary.error_colors(result, truth, np.array([[True, True, True, False]]))[0]
    scale = summary.scale()
    # Beyond +-0.25 the ends of the scale.
    expected = [scale[0], scale[summary.LEVELS // 2], scale[-1], [128, 128, 128]]
    assert colors.tolist() == np.array(expected).tolist()
    assert scale[0][2] > scale[0][0]  # blue
    assert scale[-1][0] > scale[-1][2]  # orange


def test_error_map_of_light_is_relative() -> None:
    truth = np.full((1, 2, 3), 100.0, np.float32)
    truth[0, 0] = 1.0
    colors = summary.error_colors(1.125 * truth, truth, np.ones((1, 2), np.bool_))[0]
    # +12.5 % is a quarter of the way to the end; where the truth is dark the added 1 % of the mean
    # damps it to 0.125 / 1.5 = 8 %.
    middle = summary.LEVELS // 2
    assert colors[1].tolist() == summary.scale()[middle + middle // 4].tolist()
    assert colors[0].tolist() == summary.scale()[middle + 1].tolist()


def test_exposure_makes_the_truth_of_a_group_middle_grey() -> None:
    truth = np.full((6, 6, 3), 7.0, np.float32)
    seen = np.ones((6, 6), np.bool_)
    truth[0], seen[0] = 1e6, False  # not seen, so it doesn't count
    assert summary.exposure_of(truth, seen) * 7.0 == pytest.approx(0.18, rel=1e-5)
