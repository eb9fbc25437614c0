"""The documentation site: a page for each public name, links that lead on, pictures that are small."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import ssgi_cl as gi
from ssgi_cl.rasterize import scenes
from tools import pictures
from tools.site import api_pages, docstrings, links

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"


# ---- API reference


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("api")
    (folder / "ssgi_cl.gone.rst").write_text("a name that is no more")
    api_pages.write(ROOT, folder)
    return folder


def test_each_public_name_has_a_page(made: Path) -> None:
    pages = {path.stem for path in made.glob("ssgi_cl.*.rst")}
    documented = api_pages.public_objects(ROOT)
    assert pages == set(documented)
    ids = {id(value) for value in documented.values()}
    for module in (gi, gi.rasterize, gi.truth, gi.metrics, scenes):
        shown = getattr(module, "__all__", dir(module))
        for name in set(shown) - api_pages.HIDDEN - {"rasterize", "truth", "metrics"}:
            if name[0] != "_":
                assert id(getattr(module, name)) in ids, f"{module.__name__}.{name} has no page"


def test_the_stub_names_what_the_package_shows() -> None:
    assert set(api_pages.stub_names(ROOT)) | {"__version__"} == set(gi.__all__)


def test_pages_of_names_name_their_object_and_are_in_the_index(made: Path) -> None:
    index = (made / "index.rst").read_text(encoding="utf-8")
    for path in made.glob("ssgi_cl.*.rst"):
        assert re.search(rf"^\.\. auto\w+:: {re.escape(path.stem)}$", path.read_text(encoding="utf-8"), re.MULTILINE)
        assert f":py:obj:`~{path.stem}`" in index
        assert f"\n   {path.stem}\n" in index


def test_hidden_names_are_constants_and_modules() -> None:
    for name in api_pages.HIDDEN - {"__version__"}:
        held = getattr(scenes, name, None) or getattr(gi.metrics, name)
        assert not isinstance(held, type)
        assert not callable(held) or name == "generated", name


def test_fields_of_params_become_a_list() -> None:
    doc = [
        "Args:",
        "    **params: the others.",
        "        gain: of the",
        "            signal",
        "        bias: its shift",
        "",
        "End.",
    ]
    made = docstrings.prepared(doc)
    assert made[2:6] == ["", "        * ``gain``: of the", "          signal", "        * ``bias``: its shift"]
    assert docstrings.prepared(["|n| and a * b, `a * b`"]) == [r"\|n\| and a \* b, `a * b`"]


# ---- links


@pytest.mark.parametrize(
    ("page", "link", "expected"),
    [
        ("docs/guide.md", "frames.md#limits", "/frames.md#limits"),
        ("docs/techniques/gtao.md", "../../README.md", "/index.md"),
        (
            "docs/project.md",
            "../ARCHITECTURE.md#adding-a-technique",
            "/generated/project/architecture.md#adding-a-technique",
        ),
        ("ARCHITECTURE.md", "docs/limits.md", "/limits.md"),
        ("docs/index.md", "gallery/README.rst", "/generated/gallery/index.rst"),
        ("docs/light.md", "gallery/light/soft_shadows.py", "/generated/gallery/light/soft_shadows.rst"),
        ("docs/light.md", "https://example.org/a.md", "https://example.org/a.md"),
    ],
)
def test_links_lead_to_pages_of_the_site(page: str, link: str, expected: str) -> None:
    assert links.resolved(f"see [it]({link}).", Path(page), ROOT) == f"see [it]({expected})."


def test_links_in_code_stay_and_folders_are_words() -> None:
    text = "```\n[a](../README.md)\n```\n"
    assert links.resolved(text, Path("docs/guide.md"), ROOT) == text
    assert links.resolved("[views](views)", Path("docs/guide.md"), ROOT) == "views"


def test_what_was_made_of_a_script_that_is_no_more_goes(tmp_path: Path) -> None:
    built = tmp_path / "docs/generated/gallery/light"
    built.mkdir(parents=True)
    (tmp_path / "docs/gallery/light").mkdir(parents=True)
    (tmp_path / "docs/gallery/light/kept.py").write_text("")
    for name in ("kept.rst", "gone.rst", "gone.py", "index.rst"):
        (built / name).write_text("")
    links.remove_stale(tmp_path, tmp_path / "docs")
    assert sorted(path.name for path in built.iterdir()) == ["index.rst", "kept.rst"]


# ---- the build


def test_make_setup_installs_what_the_site_needs() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert all(re.search(r"<\d", need) for need in extras["docs"] if not need.startswith("matplotlib"))
    assert re.search(r"editable '\.\[[\w,]*\bdocs\b", (ROOT / "Makefile").read_text())


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    for module in ("sphinx", "myst_parser", "pydata_sphinx_theme", "sphinx_gallery"):
        pytest.importorskip(module)
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-E", "-b", "html", "-D", "plot_gallery=0"]
    done = subprocess.run(
        [*command, "-d", str(tmp_path / "trees"), str(DOCS), str(tmp_path / "html")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for page in ("index", "start/mesh", "generated/api/ssgi_cl.gtao", "generated/project/architecture"):
        assert (tmp_path / "html" / f"{page}.html").is_file()


# ---- pictures


def test_pictures_of_docs_are_under_ten_megabytes() -> None:
    found = pictures.pictures(DOCS)
    assert len(found) > 20
    assert sum(path.stat().st_size for path in found) < pictures.MOST_BYTES


@pytest.mark.parametrize("grey", [False, True])
def test_compression_changes_no_pixel(tmp_path: Path, rng: np.random.Generator, grey: bool) -> None:
    blocks = rng.integers(0, 255, (6, 8, 1 if grey else 3), dtype=np.uint8) * np.ones(3, np.uint8)
    pixels = blocks.repeat(4, axis=0).repeat(4, axis=1)
    path = tmp_path / "a.png"
    Image.fromarray(pixels).save(path, compress_level=0)
    before = path.stat().st_size
    pictures.compress(path)
    assert path.stat().st_size < before
    with Image.open(path) as image:
        np.testing.assert_array_equal(np.asarray(image.convert("RGB")), pixels)
        assert image.mode == ("L" if grey else "RGB")


def test_pictures_of_scripts_are_compressed_and_lose_their_alpha(tmp_path: Path) -> None:
    folder = tmp_path / "generated/gallery/images"
    folder.mkdir(parents=True)
    opaque, clear = np.full((40, 40, 4), 255, np.uint8), np.full((40, 40, 4), 255, np.uint8)
    opaque[:20, :, 0], clear[:20, :, 3] = 0, 0
    for name, pixels in (("opaque", opaque), ("clear", clear)):
        Image.fromarray(pixels).save(folder / f"{name}.png")
    pictures.compress_gallery(tmp_path)
    for name, mode in (("opaque", "RGB"), ("clear", "RGBA")):
        with Image.open(folder / f"{name}.png") as image:
            assert image.mode == mode


# ---- a release


def test_a_release_has_one_version() -> None:
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {gi.__version__}\n" in citation
    assert re.search(rf"^## {re.escape(gi.__version__)}\b", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert f"first release is {gi.__version__}" in (DOCS / "versions.md").read_text("utf-8")


def test_forms_for_bugs_ask_for_devices() -> None:
    for name in ("bug", "slow"):
        assert "ssgi doctor" in (ROOT / f".github/ISSUE_TEMPLATE/{name}.yml").read_text("utf-8")
