"""The report: one file that stands alone."""

from __future__ import annotations

import base64
import io
import json
import math
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from ssgi_cl.bench import front, pictures, plot, report
from ssgi_cl.bench.suite import Pictures

from .documents import entry, whole

VOID = {"meta", "img", "input", "br", "link"}


class Page(HTMLParser):
    """What a page holds; tags that don't match are an error."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert len({name for name, _ in attrs}) == len(attrs), f"{tag} says something twice"
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def text(self) -> str:
        return "".join(self.words)


def written(tmp_path: Path, document: dict[str, Any], shown: dict[str, Pictures] | None = None) -> tuple[str, Page]:
    path = tmp_path / "report.html"
    report.write(path, document, shown or {})
    text = path.read_text(encoding="utf-8")
    return text, Page(text)


def images(text: str) -> dict[str, Image.Image]:
    found = re.search(r'id="pictures">(.*?)</script>', text, re.DOTALL)
    assert found
    decoded = {}
    for name, uri in json.loads(found[1]).items():
        kind, _, packed = uri.partition(",")
        assert kind == "data:image/webp;base64"
        decoded[name] = Image.open(io.BytesIO(base64.b64decode(packed, validate=True)))
        decoded[name].load()
    return decoded


@pytest.fixture
def truth(rng: np.random.Generator) -> np.ndarray:
    return rng.random((6, 8), np.float32)


def shown_as(result: np.ndarray, truth: np.ndarray | None, also: Any = None) -> Pictures:
    return Pictures(result, truth, also, np.ones(result.shape[:2], np.bool_))


def full(truth: np.ndarray) -> tuple[dict[str, Any], dict[str, Pictures]]:
    light = np.stack([truth, truth, 3.0 * truth], axis=-1)
    results = [
        entry("ssao.4.hall.8x6", 2.0, 0.09),
        entry("ssao.16.hall.8x6", 6.0, 0.05, note="a note"),
        entry("embree.1.hall.8x6", 9.0, 0.2, device_ms=None, unsteady="it jumps"),
        entry("embree.4.hall.8x6", 30.0, 0.1, device_ms=None),
        entry("shade.sun.hall.8x6", 5.0, 0.3, quantity="direct"),
        entry("gbuffer.full.hall.8x6", 5.0, quantity="", errors={}),
    ]
    front.mark(results)
    shown = {
        "ssao.4.hall.8x6": shown_as(0.8 * truth, truth, 0.9 * truth),
        "ssao.16.hall.8x6": shown_as(0.9 * truth, truth, 0.9 * truth),
        "embree.1.hall.8x6": shown_as(truth, truth),
        "shade.sun.hall.8x6": shown_as(2.0 * light, light),
    }
    skipped = [{"name": "vtk.1.hall.8x6", "reason": "pip install 'ssgi-cl[peers]'"}]
    return whole(*results, skipped=skipped), shown


def test_report_has_plot_table_viewer_and_regions_of_each_group(tmp_path: Path, truth: np.ndarray) -> None:
    _, page = written(tmp_path, *full(truth))
    assert len(page.all("section")) == 5  # a guide, three groups, and what was skipped
    plots = [tag for tag in page.all("svg") if tag["class"] == "plot"]
    assert len(plots) == 2
    assert len(page.all("select")) == 2
    assert len(page.all("option")) == 4
    for words in (
        "Ambient occlusion, hall, 8 x 6",
        "Direct light",
        "a note",
        "~ it jumps",
        "Made up 1.0: CPU",
        "abc1234",
        "memory 31.0 GB/s",
        "2024-05-06",
        "numpy 2.0",
        "The least error within a time",
        "pip install 'ssgi-cl[peers]'",
    ):
        assert words in page.text
    assert "vtk None" not in page.text
    # Half a case's error lies in a quarter of its pixels, at twice the RMSE.
    bars = [str(tag["aria-label"]) for tag in page.all("div") if tag.get("class") == "bar"]
    assert [bar for bar in bars if bar.startswith("squared error")] == [
        "squared error: creases 57 %, elsewhere 43 %"
    ] * 5


def test_shares_without_a_world_truth_are_not_called_light(tmp_path: Path, truth: np.ndarray) -> None:
    blur = entry("blur.2.hall.8x6", 2.0, quantity="", errors={})
    text, _ = written(tmp_path, whole(blur), {blur["name"]: shown_as(truth, None, truth)})
    assert "white is 1, without gamma" in text
    assert "too dark, -0.25 or less" in text
    assert "filmic" not in text.partition("<figcaption>")[2].partition("</figcaption>")[0]


def test_report_fetches_nothing(tmp_path: Path, truth: np.ndarray) -> None:
    text, page = written(tmp_path, *full(truth))
    assert "://" not in text
    assert "url(" not in text
    assert not page.all("link")
    assert all("src" not in attributes for _, attributes in page.tags)
    links = [str(attributes["href"]) for _, attributes in page.tags if "href" in attributes]
    assert links
    assert all(link.startswith("#") for link in links)
    ids = {attributes.get("id") for _, attributes in page.tags}
    assert {link[1:] for link in links} <= ids
    assert any("default-src 'none'" in str(tag.get("content")) for tag in page.all("meta"))


def test_pictures_are_in_the_file_once_and_decode(tmp_path: Path, truth: np.ndarray) -> None:
    text, page = written(tmp_path, *full(truth))
    decoded = images(text)
    assert all(image.size == (8, 6) for image in decoded.values())
    used = [value for option in page.all("option") for name, value in option.items() if name.startswith("data-")]
    assert set(used) == set(decoded)
    options = page.all("option")
    assert options[0]["data-world"] == options[1]["data-world"]
    assert options[0]["data-error"] != options[1]["data-error"]
    assert options[1]["data-assumption"] == options[1]["data-result"]  # both 0.9 of the truth
    assert "data-assumption" not in options[2]
    grey = np.asarray(decoded[str(options[0]["data-world"])].convert("L"), np.float32)
    # WebP at 85 of a picture of noise: a mean difference of a few of 255 steps.
    assert np.abs(grey - 255.0 * truth).mean() < 8.0


def test_viewer_can_be_used_by_keyboard_and_ear(tmp_path: Path, truth: np.ndarray) -> None:
    _, page = written(tmp_path, *full(truth))
    sliders = [tag for tag in page.all("input") if tag["type"] == "range"]
    assert len(sliders) == 2
    assert all(tag["aria-label"] for tag in sliders)
    assert all(tag["alt"] for tag in page.all("img"))
    assert all(tag["aria-label"] for tag in page.all("svg") if tag.get("role") == "img")
    names = {tag["name"] for tag in page.all("input") if tag["type"] == "radio"}
    assert len(names) == 2  # the groups' choices are apart


def test_text_of_the_document_is_escaped(tmp_path: Path, truth: np.ndarray) -> None:
    evil = "</script><b>&\"'"
    result = entry(
        "a.1.hall.8x6",
        family=f"f{evil}",
        setting=f"1{evil}",
        scene=f"s{evil}",
        note=evil,
        unsteady=evil,
        quantity=f"q{evil}",
        passes=[{"name": evil, "ms": 1.0}, {"name": "b", "ms": 1.0}],
    )
    document = whole(result, skipped=[{"name": evil, "reason": evil}], created=evil, revision=evil)
    document["device"]["label"] = document["machine"]["cpu"] = evil
    document["versions"]["numpy"] = document["options"]["attenuation"] = evil
    text, page = written(tmp_path, document, {"a.1.hall.8x6": shown_as(truth, truth)})
    assert not page.all("b")
    assert len(page.all("script")) == 2
    assert "<b>" not in text
    assert f"q{evil}, s{evil}, 8 x 6" in page.text


@pytest.mark.parametrize("skipped", [[], [{"name": "a.1.hall.8x6", "reason": "why"}]])
def test_report_of_nothing_says_so(tmp_path: Path, skipped: list[dict[str, str]]) -> None:
    _, page = written(tmp_path, whole(skipped=skipped))
    assert "Nothing was measured." in page.text
    assert ("a.1.hall.8x6: why" in page.text) == bool(skipped)
    assert not page.all("svg")


@pytest.mark.parametrize("rmse", [0.0, 0.05, None, math.inf])
@pytest.mark.parametrize("ms", [0.0, 2.0])
def test_one_point_of_any_size_makes_a_page(tmp_path: Path, rmse: float | None, ms: float) -> None:
    text, page = written(tmp_path, whole(entry(ms=ms, rmse=rmse)))
    plots = [tag for tag in page.all("svg") if tag["class"] == "plot"]
    assert len(plots) == (rmse is not None and math.isfinite(rmse))
    body = text[text.index("<body>") :]
    assert not re.search(r"\b(nan|inf)\b", body)


def test_pictures_without_a_truth_or_with_infinities_make_a_page(tmp_path: Path, truth: np.ndarray) -> None:
    name = "ssao.16.hall.8x6"
    _, page = written(tmp_path, whole(entry()), {name: shown_as(truth, None)})
    assert not page.all("select")
    broken = truth.copy()
    broken[0] = [np.nan, np.inf, -np.inf, *broken[0, 3:]]
    dark = Pictures(broken, broken, None, np.zeros(truth.shape, np.bool_))
    text, _ = written(tmp_path, whole(entry()), {name: dark})
    assert len(images(text)) == 2
    light = Pictures(np.stack([broken] * 3, -1), np.zeros((6, 8, 3), np.float32), None, dark.seen)
    text, _ = written(tmp_path, whole(entry(quantity="direct")), {name: light})
    assert len(images(text)) == 3


def test_report_that_fails_leaves_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text("old")
    with pytest.raises(KeyError):
        report.write(path, {**whole(), "device": {}}, {})
    assert path.read_text() == "old"
    with pytest.raises(FileNotFoundError, match="cannot write the file"):
        report.write(tmp_path / "none" / "a.html", whole(), {})


def test_error_map_tells_dark_from_bright_and_greys_what_is_not_seen() -> None:
    truth = np.full((1, 4), 0.5, np.float32)
    result = np.array([[0.1, 0.5, 0.9, 0.9]], np.float32)
    uri = pictures.error_map(result, truth, np.array([[True, True, True, False]]))
    colors = np.asarray(Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))))[0]
    scale = pictures.scale()
    # Beyond +-0.25 the ends of the scale; WebP without loss keeps colours exactly.
    expected = [scale[0], scale[pictures.LEVELS // 2], scale[-1], [128, 128, 128]]
    assert colors.tolist() == np.array(expected).tolist()
    assert scale[0][2] > scale[0][0]  # blue
    assert scale[-1][0] > scale[-1][2]  # orange


def test_error_map_of_light_is_relative() -> None:
    truth = np.full((1, 2, 3), 100.0, np.float32)
    truth[0, 0] = 1.0
    uri = pictures.error_map(1.125 * truth, truth, np.ones((1, 2), np.bool_))
    colors = np.asarray(Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))))[0]
    # +12.5 % is a quarter of the way to the end; where the truth is dark the added 1 % of the mean
    # damps it to 0.125 / 1.5 = 8 %.
    middle = pictures.LEVELS // 2
    assert colors[1].tolist() == pictures.scale()[middle + middle // 4].tolist()
    assert colors[0].tolist() == pictures.scale()[middle + 1].tolist()


def test_exposure_makes_the_truth_of_a_group_middle_grey() -> None:
    truth = np.full((6, 6, 3), 7.0, np.float32)
    seen = np.ones((6, 6), np.bool_)
    truth[0], seen[0] = 1e6, False  # not seen, so it doesn't count
    assert pictures.exposure_of(truth, seen) * 7.0 == pytest.approx(0.18, rel=1e-5)


def test_axis_names_values_within_and_puts_zero_at_its_low_end() -> None:
    axis = plot.Axis.over([0.0, 0.02, 0.5], 0.0, 100.0)
    assert axis.ticks() == pytest.approx([0.02, 0.05, 0.1, 0.2, 0.5])
    assert axis.at(0.0) == 0.0
    assert 0.0 < axis.at(0.02) < axis.at(0.1) < axis.at(0.5) < 100.0
    assert len(plot.Axis.over([3.0], 0.0, 100.0).ticks()) >= 2
    assert plot.Axis.over([1e-6, 1e3], 0.0, 100.0).ticks() == pytest.approx([10.0**power for power in range(-6, 4)])


@pytest.mark.parametrize(
    ("settings", "order"),
    [
        # Numbers by their value, whatever the time: 16 is the slowest here.
        (["4", "64", "16"], [0, 2, 1]),
        # Names by time.
        (["low", "high", "ultra"], [0, 1, 2]),
    ],
)
def test_settings_are_joined_in_their_order(settings: list[str], order: list[int]) -> None:
    times = [1.0, 2.0, 4.0]
    results = [entry(f"a.{s}.hall.8x6", t) for s, t in zip(settings, times, strict=True)]
    drawn = plot.plot(results, plot.looks(["a"], []), "a", "occlusion")
    line = re.search(r'class="line c0" d="M([^"]*)"', drawn)
    assert line
    across = [float(point.split()[0]) for point in line[1].split("L")]
    assert [sorted(across).index(x) for x in across] == order


def test_peers_are_dashed_and_unsteady_points_hollow() -> None:
    results = [
        entry("a.1.hall.8x6", 1.0),
        entry("a.2.hall.8x6", 2.0, 0.04, unsteady="it jumps"),
        entry("b.1.hall.8x6", 3.0),
        entry("b.2.hall.8x6", 4.0, 0.04),
    ]
    drawn = plot.plot(results, plot.looks(["a", "b"], ["b"]), "t", "occlusion")
    assert 'class="line c0"' in drawn
    assert 'class="line dashed c1"' in drawn
    assert drawn.count("point unsteady") == 1
    assert "unsteady: it jumps" in drawn


def test_labels_cover_neither_points_nor_each_other() -> None:
    points = [(300.0 + 4.0 * i, 200.0 + 3.0 * i, f"{i}-half") for i in range(20)]
    placed = [text for text in plot._labels(points) if text]
    assert 2 <= len(placed) < 20  # the rest has its title alone
    spots = []
    for text in placed:
        found = re.match(r'<text x="([\d.]+)" y="([\d.]+)" class="(\w+)">(.*)</text>', text)
        assert found
        wide = 6.4 * len(found[4])
        left = float(found[1]) - {"start": 0.0, "middle": 0.5, "end": 1.0}[found[3]] * wide
        spots.append((left, float(found[2]) - 9.0, left + wide, float(found[2]) + 2.0))
    for i, spot in enumerate(spots):
        assert not plot._overlaps(spot, spots[:i])
