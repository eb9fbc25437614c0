"""Error maps and exposure."""

from __future__ import annotations

import numpy as np
import pytest

from ssgi_cl.bench import summary as pictures


def test_error_map_tells_dark_from_bright_and_greys_what_is_not_seen() -> None:
    truth = np.full((1, 4), 0.5, np.float32)
    result = np.array([[0.1, 0.5, 0.9, 0.9]], np.float32)
    colors = pictures.error_colors(result, truth, np.array([[True, True, True, False]]))[0]
    scale = pictures.scale()
    # Beyond +-0.25 the ends of the scale.
    expected = [scale[0], scale[pictures.LEVELS // 2], scale[-1], [128, 128, 128]]
    assert colors.tolist() == np.array(expected).tolist()
    assert scale[0][2] > scale[0][0]  # blue
    assert scale[-1][0] > scale[-1][2]  # orange


def test_error_map_of_light_is_relative() -> None:
    truth = np.full((1, 2, 3), 100.0, np.float32)
    truth[0, 0] = 1.0
    colors = pictures.error_colors(1.125 * truth, truth, np.ones((1, 2), np.bool_))[0]
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
