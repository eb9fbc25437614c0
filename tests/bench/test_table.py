"""Results in the terminal."""

from __future__ import annotations

from typing import Any

import pytest

from ssgi_cl.bench import table, wording

from .documents import entry, printed, whole


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
