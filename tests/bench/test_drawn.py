"""Inputs of a case beyond the base G-buffer are drawn in each run, and so are timed."""

from __future__ import annotations

import pytest

from ssgi_cl.bench.cases import OWN
from ssgi_cl.bench.drawn import DrawnMaps, DrawnView
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.tuning.context import Context

SIZE = (30, 40)


@pytest.fixture(scope="module")
def context(runtime: Runtime) -> Context:
    return Context(runtime, cornell_box(), SIZE)


@pytest.fixture
def draws(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Notes each drawing of a G-buffer and of light maps."""
    noted: list[str] = []

    def noting(kind: type, name: str, what: str) -> None:
        original = getattr(kind, name)

        def call(*given: object, **options: object) -> object:
            noted.append(what)
            return original(*given, **options)

        monkeypatch.setattr(kind, name, call)

    noting(DrawnView, "draw", "view")
    noting(DrawnMaps, "reflective", "maps")
    noting(DrawnMaps, "shadows", "maps")
    return noted


@pytest.mark.parametrize(
    ("family", "setting", "passes", "maps"),
    [
        ("gtao", "1x4-2", 2, 0),
        ("vpl", "64", 1, 1),
        ("direct", "64", 0, 1),
        *(  # by the same makers
            pytest.param(*of, marks=pytest.mark.slow)
            for of in (
                ("gtao", "1x4", 1, 0),
                ("gtao-preset", "low-2", 2, 0),
                ("vpl-visibility", "64", 1, 1),
                ("vpl-visibility-seen", "64", 4, 1),
                ("multires", "40-permille", 1, 1),
                ("rsm-gather", "100", 0, 1),
                ("ssdo-bitmask-layers", "1", 2, 1),
            )
        ),
    ],
)
def test_layers_and_maps_are_drawn_in_every_run(
    family: str, setting: str, passes: int, maps: int, context: Context, draws: list[str]
) -> None:
    subject = OWN[family].prepare(context, setting)
    with context.runtime.frame():
        subject.run()
    passes_of = []
    for _ in range(2):
        draws.clear()
        with context.runtime.frame():
            subject.run()
        ran = [p.name for p in context.runtime.times() if not p.skipped]
        assert draws.count("maps") == maps
        assert draws.count("view") == (1 if passes else 0)
        # A name of the rasteriser's passes for each layer; none for the base G-buffer.
        drawn = any("raster" in name for name in ran)
        assert drawn == (passes > 1 or maps > 0), ran
        passes_of.append(ran)
    assert passes_of[0] == passes_of[1]  # nothing, such as chosen lights, is kept from one to the next
    said = subject.counted
    assert ("layers" in said) == (passes > 1)
    assert ("maps drawn" in said) == (maps > 0)


def test_layers_and_further_cameras_of_a_frame_are_drawn(context: Context) -> None:
    counts = []
    for setting in ("drawn-1", "drawn-2", "cameras-1", "cameras-2"):
        subject = OWN["ssdo-frame"].prepare(context, setting)
        with context.runtime.frame():
            subject.run()
        ran = [p.name for p in context.runtime.times() if not p.skipped]
        counts.append(sum(name.startswith("raster_tiles") for name in ran))
    # A pass for each layer and each auxiliary camera.
    assert counts == [1, 2, 2, 3]


def test_the_base_view_draws_nothing_and_says_nothing(context: Context) -> None:
    view = DrawnView(context, 1, 0.0)
    assert view.draw() is context.gbuffer
    assert view.counted == ""
    deep = DrawnView(context, 2, 0.1)
    assert deep.counted == "G-buffer of 2 layers and 10 % overscan drawn"
    assert deep.gbuffer.margin != (0, 0)
    assert deep.gbuffer is deep.draw() is not context.gbuffer
