"""Gain of far more samples, as numbers and as a table."""

from __future__ import annotations

import pytest
from click.testing import CliRunner

from ssgi_cl.bench.experiments.gain import Gain, gains, main, table
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import cornell_box
from ssgi_cl.tuning.context import Context, TruthSettings

pytestmark = pytest.mark.usefixtures("own_store")


def test_more_samples_err_a_little_less(runtime: Runtime) -> None:
    pytest.importorskip("embreex", reason="embreex is not installed (extra 'truth')")
    context = Context(runtime, cornell_box(), (45, 60), TruthSettings(rays=64))
    (gain,) = gains(context, ["gtao"], most=8)
    assert (gain.technique, gain.scene) == ("gtao", "cornell_box")
    # Blurred, few slices do nearly as well as many. Truth of 64 rays is off by some .02 itself.
    assert -0.05 < gain.share < 0.3
    assert 0.03 < gain.most < 0.3


def test_a_table_has_a_row_for_each_technique_and_scene() -> None:
    assert table([Gain("gtao", "hall", 0.08, 0.076)]).splitlines()[2:] == ["| gtao | hall | 0.0800 | 0.0760 | 5.0 % |"]


def test_an_unknown_scene_is_refused_in_a_line() -> None:
    shown = CliRunner().invoke(main, ["--scene", "attic"])
    assert shown.exit_code == 1
    assert shown.output.startswith("Error: scene is 'attic': expected a file or one of")
