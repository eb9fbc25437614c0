"""The sentence that tells from which error on rays are the better choice."""

from __future__ import annotations

import pytest

from ssgi_cl.bench.verdict import rays_ms, verdict

from .documents import entry

RAYS = [entry("embree.1.hall.8x6", 10.0, 0.4), entry("embree.4.hall.8x6", 40.0, 0.1)]


def test_between_two_settings_the_time_of_rays_is_a_power_of_the_error() -> None:
    # Half way in the logarithm of the error: the geometric mean of both times.
    assert rays_ms(RAYS, 0.2) == pytest.approx(20.0)
    assert rays_ms(RAYS, 0.1) == pytest.approx(40.0)
    assert rays_ms(RAYS, 0.9) == 10.0  # one ray does more than is asked
    assert rays_ms(RAYS, 0.05) is None


def test_the_faster_of_plain_and_blurred_rays_counts() -> None:
    both = [*RAYS, entry("embree-blur.1.hall.8x6", 12.0, 0.08)]
    assert rays_ms(both, 0.1) == 12.0


def test_rays_are_better_below_the_least_error_that_is_reached_sooner_than_they_do() -> None:
    own = [
        entry("ssao.4.hall.8x6", 2.0, 0.3), entry("ssao.16.hall.8x6", 8.0, 0.2),
        entry("ssao.64.hall.8x6", 60.0, 0.15),
    ]
    said = verdict([*RAYS, *own])
    assert "below an RMSE of 0.200, which ssao.16 has in 8.00 ms (rays need 20.0 ms)" in said


def test_where_rays_are_always_sooner_or_never_as_good_it_says_so() -> None:
    slow = entry("ssao.4.hall.8x6", 50.0, 0.3)
    assert verdict([*RAYS, slow]).startswith("Rays against the mesh reach every error")
    good = entry("ssao.4.hall.8x6", 50.0, 0.01)
    said = verdict([*RAYS, good])
    assert said.startswith("No rays measured reach an RMSE of 0.0100, which ssao.4 has in 50.0 ms")
    assert "better choice below" not in said  # nothing was measured there


def test_without_rays_or_without_ours_nothing_is_said() -> None:
    assert verdict(RAYS) == ""
    assert verdict([entry("ssao.4.hall.8x6")]) == ""
    assert verdict([*RAYS, entry("ssao.4.hall.8x6", rmse=None)]) == ""


def test_with_the_tree_counted_rays_are_told_of_separately() -> None:
    both = [
        *RAYS, entry("embree-moving.1.hall.8x6", 30.0, 0.4),
        entry("embree-moving.4.hall.8x6", 60.0, 0.1),
    ]
    own = [entry("ssao.16.hall.8x6", 8.0, 0.2), entry("ssao.64.hall.8x6", 55.0, 0.1)]
    still, _, moving, first = verdict([*both, *own]).split(". ")
    assert "below an RMSE of 0.200" in still
    assert still.endswith("the building of their tree not counted")
    assert "below an RMSE of 0.100, which ssao.64 has in 55.0 ms (rays need 60.0 ms)" in moving
    assert moving.endswith("the building of their tree counted")
    assert first == (
        "The fastest of these rays, embree-moving.1, has an RMSE of 0.400 in 30.0 ms; at that cost "
        "ssao.16 has 0.200, in 8.00 ms."
    )


def test_a_published_setting_is_held_to_the_best_of_ours_at_the_same_cost() -> None:
    published = entry("xegtao.high.hall.8x6", 10.0, 0.08)
    own = [entry("gtao.2x9.hall.8x6", 10.4, 0.07), entry("gtao.4x9.hall.8x6", 11.0, 0.06)]
    assert verdict([published, *own]) == (
        "XeGTAO's High setting has an RMSE of 0.0800 in 10.0 ms; at that cost gtao.2x9 has 0.0700, "
        "in 10.4 ms."
    )
    assert verdict([published]) == ""
    assert "nothing of this library is as fast" in verdict([published, own[1]])


def test_a_bound_is_no_result_of_this_library() -> None:
    floor = entry("floor.1.hall.8x6", 0.0, 0.15, timed=False)
    assert verdict([*RAYS, floor]) == ""


def test_unsteady_results_do_not_count() -> None:
    lucky = entry("ssao.4.hall.8x6", 1.0, 0.11, unsteady="the machine was busy")
    assert verdict([*RAYS, lucky]) == ""
    assert "below an RMSE of 0.300" in verdict([*RAYS, lucky, entry("ssao.16.hall.8x6", 5.0, 0.3)])
