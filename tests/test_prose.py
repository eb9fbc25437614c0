"""The pages: words, links, examples, and names of files and functions that they state."""

from __future__ import annotations

import io
import re
import subprocess
import sys
import tokenize
from pathlib import Path

import pytest

import ssgi_cl as gi
from ssgi_cl.bench import figure_tables, parameter_tables
from ssgi_cl.core.params import describe
from ssgi_cl.techniques import catalogue

ROOT = Path(__file__).parents[1]

CLEAN = (
    "README.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "kernels/README.md",
    "docs/guide.md",
    "docs/devices.md",
    "docs/results.md",
    "docs/limits.md",
    "docs/indirect.md",
    "docs/benchmark.md",
    "docs/agreement.md",
    "docs/summation.md",
    *(f"docs/techniques/{path.name}" for path in sorted((ROOT / "docs/techniques").glob("*.md"))),
)
"""Pages that use none of `WORDS`."""

PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in (*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), ROOT / "kernels/README.md")
)

WORDS = {
    r"openness": "ambient occlusion (AO) value, visibility",
    r"lamps?": "light",
    r"roads?": "method",
    r"(make|makes|takes?) room|room for": "reserve, memory budget",
    r"the house": "the code base",
    r"mends?|mended": "fix",
    r"by the hour": "run-to-run range",
    r"(in a )?slow hour": "on a slow run",
    r"the same bits": "bit-identical",
    r"twins?": "reference implementation",
    r"walls?(?![- ](time|clock))": "visibility, occupancy grid, surfaces",
    r"sight grid": "occupancy grid",
    r"lines of sight": "shadow rays",
    r"further (cameras?|views?)": "auxiliary cameras",
    r"the lecture": "the published method, with paper and year",
    r"the truth|the assumption": "reference, converged model",
    r"withstands?": "tested inputs",
    r"runs of (lights|triangles)": "clusters, batches",
    r"calm": "unoccluded",
    r"pace": "device speed model",
    r"words of": "part of (a label)",
    r"tend to|tends": "manage; converge",
}
"""What not to say -> what to say. Patterns match whole words outside of code."""

CODE_WORDS = {
    r"lamps?": "light, punctual light",
    r"openness": "visibility",
    r"pace": "speed model",
    r"twins?": "numpy reference",
    r"SightGrid": "OccupancyGrid",
    r"FurtherViews|further (cameras?|views?)": "auxiliary cameras, views",
    r"TileFacts": "TileSummary",
    r"form_runtime|Form": "KernelVariant",
    r"unbent|UNBENT": "no_second_difference",
    r"(near|pair)_room": "capacity",
    r"[Ss]ights?|sight_\w+": "view ray, visibility ray",
    r"Occluder|Opener": "TiledOcclusion, OpenTileFinder",
    r"tiles?[_ ](facts|calm)": "tile summary, interior tiles",
    r"multires[_ ]rough": "multires_gradient",
    r"vpl[_ ]runs": "vpl_partial_sums",
    r"[A-Z]+_FACING": "LEAST_N_DOT_V, BOUNDS_NORMAL",
}
"""Words that neither identifiers nor comments nor texts of code use -> what to say."""

OWN_WORDS = ("tests/test_prose.py", "rasterize/scenes/")
"""This file, and scenes, where a lamp is a thing."""

CODE = re.compile(r"^```.*?^```|^    .*?$|`[^`\n]*`", re.DOTALL | re.MULTILINE)
LINK = re.compile(r"(?<!`)!?\[[^\]]*\]\(([^)\s]+)\)")


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def found(page: str) -> list[str]:
    """Return the words of `WORDS` in a page's prose, with what to say."""
    prose = re.sub(r"\s+", " ", CODE.sub(" ", page))
    return [
        f"{match[0]!r}: say {better}"
        for pattern, better in WORDS.items()
        for match in re.finditer(rf"(?<![-\w.])(?:{pattern})(?![-\w])", prose, re.IGNORECASE)
    ]


@pytest.mark.parametrize("name", CLEAN)
def test_pages_use_standard_words(name: str) -> None:
    assert not found(text(name))


@pytest.mark.parametrize("word", ["Lamps", "by the\nhour", "a wall,", "the\nsame bits", "roads"])
def test_words_are_found_in_prose_across_lines(word: str) -> None:
    assert found(f"Some text with {word} in it.")


@pytest.mark.parametrize("code", ["`shadow_taps` and `walls`", "```\nlamp\n```", "vpl-visibility.4096"])
def test_words_in_code_and_names_of_cases_are_no_prose(code: str) -> None:
    assert not found(f"Some text\n{code}\nand more.")


ANY_CODE_WORD = re.compile("|".join(rf"\b(?:{pattern})\b" for pattern in CODE_WORDS))


def found_in_code(source: str, *, python: bool) -> list[str]:
    """Return the words of `CODE_WORDS` in identifiers, comments and texts of a source."""
    parts = [source]
    if python:
        # Strings of one word may be keys of recorded files.
        parts = [
            token.string
            for token in tokenize.generate_tokens(io.StringIO(source).readline)
            if token.type in (tokenize.NAME, tokenize.COMMENT)
            or (token.type == tokenize.STRING and " " in re.sub(r"\s", " ", token.string))
        ]
    flat = " | ".join(re.sub(r"\s+", " ", part) for part in parts)
    if not ANY_CODE_WORD.search(flat):
        return []
    return [
        f"{match[0]!r}: say {better}"
        for pattern, better in CODE_WORDS.items()
        for match in re.finditer(rf"\b(?:{pattern})\b", flat)
        if flat[max(match.start() - 1, 0)] not in "-.`/"
    ]


def test_code_uses_standard_words() -> None:
    names = subprocess.run(
        ["git", "ls-files", "*.py", "*.pyi", "*.cl", "*.clh"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.split()
    if not names:
        pytest.skip("not a git checkout")
    said = {
        name: found_in_code(text(name), python=".py" in name)
        for name in names
        if not name.startswith(OWN_WORDS) and (ROOT / name).exists()
    }
    assert not {name: words for name, words in said.items() if words}


@pytest.mark.parametrize(
    "source", ["lamp = 1", "def f(openness): ...", "# of a lamp", '"""The numpy\ntwin."""', "x.pace = 2"]
)
def test_words_are_found_in_python(source: str) -> None:
    assert found_in_code(source, python=True)


def test_words_are_found_in_kernels() -> None:
    assert found_in_code("float lamps = 0.0f; // of all", python=False)
    assert not found_in_code("float lights = 0.0f;", python=False)


def test_readme_is_short() -> None:
    assert len(text("README.md").splitlines()) < 150


@pytest.mark.parametrize("name", PAGES)
def test_links_of_pages_resolve(name: str) -> None:
    folder = (ROOT / name).parent
    links = [link.partition("#")[0] for link in LINK.findall(text(name)) if "://" not in link]
    missing = [link for link in links if link and not (folder / link).exists()]
    assert not missing


def test_every_page_can_be_reached_from_readme() -> None:
    reached, waiting = set(), ["README.md"]
    while waiting:
        name = waiting.pop()
        if name in reached:
            continue
        reached.add(name)
        for link in LINK.findall(text(name)):
            path = ((ROOT / name).parent / link.partition("#")[0]).resolve()
            if path.suffix == ".md" and path.is_file():
                waiting.append(path.relative_to(ROOT).as_posix())
    assert reached == set(PAGES)


def test_walks_and_pages_name_what_exists() -> None:
    page = text("ARCHITECTURE.md")
    rows = re.findall(r"^\| [^|]+ \| `([^`]+)` \| `(\w+)` \|$", page, re.MULTILINE)
    assert len(rows) >= 16
    absent = [
        (path, name)
        for path, name in rows
        if not re.search(rf"(def|class|void|vfloat|bool|^) ?{name}\b", text(path), re.MULTILINE)
    ]
    assert not absent
    paths = re.compile(r"`((?:ssgi_cl|kernels|tests|tools|bench|docs)/[\w/.-]+\.[a-z]+)`")
    missing = [
        (page, path)
        for page in CLEAN
        if page != "CHANGELOG.md"
        for path in paths.findall(text(page))
        if "NAME" not in path and not (ROOT / path).exists()
    ]
    assert not missing


@pytest.mark.parametrize("name", figure_tables.PAGES)
def test_pages_of_techniques_have_all_their_parts(name: str) -> None:
    page = text(f"docs/techniques/{name}.md")
    headings = re.findall(r"^## (.*)$", page, re.MULTILINE)
    assert [head.partition(" from ")[0] for head in headings] == ["Method", "Parameters", "Cost", "Error", "Departures"]
    assert page.startswith(f"# {name}: ")
    assert f"](../images/{name}.png)" in page
    assert f"`python -m tools.technique_pictures {name}`" in page
    assert re.search(r"\b(19|20)\d\d\b", page.partition("## ")[0])
    assert f"[{name}]({name}.md)" in text("docs/techniques/README.md")


def test_every_public_technique_has_a_page_and_every_parameter_a_row() -> None:
    functions = {name for name, value in vars(catalogue).items() if name in catalogue.TECHNIQUES and callable(value)}
    assert functions <= set(figure_tables.PAGES)
    assert {f"docs/techniques/{name}.md" for name in (*figure_tables.PAGES, "README")} == {
        page for page in PAGES if page.startswith("docs/techniques/")
    }
    public = {getattr(gi, name) for name in dir(gi) if name.endswith("Params")}
    assert public <= set(parameter_tables.PARAMETERS.values())
    for name, params in parameter_tables.PARAMETERS.items():
        page = text(f"docs/techniques/{name.partition('-')[0]}.md")
        rows = re.findall(rf"figures:parameters-{name} -->\n(.*?)<!-- end -->", page, re.DOTALL)
        shown = re.findall(r"^\| `(\w+)` \| ([^|]*) \|", rows[0], re.MULTILINE)
        assert shown == [(field, default) for field, default, _ in describe(params)]


def test_pictures_of_pages_are_small_and_all_used() -> None:
    shown = {Path(link).name for page in PAGES for link in LINK.findall(text(page)) if "images/" in link}
    kept = {path.name: path.stat().st_size for path in (ROOT / "docs/images").iterdir()}
    assert shown == set(kept)
    assert max(kept.values()) < 200 * 1024


def test_the_example_of_readme_runs_as_it_stands(tmp_path: Path) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", text("README.md"), re.DOTALL)
    assert len([line for line in code.splitlines() if line]) <= 11
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning:__main__", "-c", code],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "hall.png").stat().st_size > 10_000
    assert "gtao" in done.stdout
