"""`ssgi view`: what it opens, and what it says of what cannot be opened."""

from __future__ import annotations

import urllib.request
from pathlib import Path

import pytest
from click.testing import CliRunner

import ssgi_cl as gi
from ssgi_cl.cli.command import main
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.viewer import server
from ssgi_cl.viewer.source import open_source

OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("hal", "did you mean 'hall'"),
        ("gone.npz", "no such file"),
        ("gone.exr", "no such file"),
        ("gone.glb", "gone.glb"),
    ],
)
def test_what_is_not_there_is_said(name: str, message: str) -> None:
    result = CliRunner().invoke(main, ["view", name])
    assert result.exit_code == 1
    assert message in result.output
    assert "Traceback" not in result.output


def test_a_file_that_is_no_environment_is_said() -> None:
    result = CliRunner().invoke(main, ["view", "hall", "--environment", "gone.hdr"])
    assert result.exit_code == 2
    assert "gone.hdr" in result.output


def test_the_extra_is_named_where_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(server.__dict__, "viser", _missing)
    result = CliRunner().invoke(main, ["view", "cornell_box"])
    assert result.exit_code == 1
    assert "ssgi-cl[viewer]" in result.output


def _missing() -> None:
    raise gi.MissingExtraError("it is not installed: pip install 'ssgi-cl[viewer]'")


def test_a_file_that_vanishes_is_named_when_it_is_read_again(tmp_path: Path, runtime: Runtime) -> None:
    path = tmp_path / "a.obj"
    path.write_text(OBJ)
    source = open_source(str(path), runtime)
    assert source.reload is not None
    assert source.reload().scene is not None
    path.unlink()
    with pytest.raises((OSError, ValueError), match=r"a\.obj"):
        source.reload()


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")
def test_the_window_serves_its_page_on_localhost_and_no_other_file(runtime: Runtime) -> None:
    pytest.importorskip("viser", reason="the extra viewer is not installed")
    window = gi.view("cornell_box", port=8400, runtime=runtime)
    try:
        assert window.url.startswith("http://localhost:84")
        assert f'src="{window.url}"' in window._repr_html_()
        with urllib.request.urlopen(window.url, timeout=30) as page:
            assert b"<html" in page.read()[:500].lower()
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(f"{window.url}/..%2f..%2f..%2fetc/passwd", timeout=30)
        assert window.tabs == ()
    finally:
        window.close()


@pytest.mark.parametrize(
    ("arguments", "message"), [({"source": 3}, "source is int"), ({"source": "cornell_box", "port": 0}, "port is 0")]
)
def test_bad_arguments_of_view(arguments: dict[str, object], message: str, runtime: Runtime) -> None:
    with pytest.raises((TypeError, ValueError), match=message):
        gi.view(**arguments, runtime=runtime)  # type: ignore[arg-type]
