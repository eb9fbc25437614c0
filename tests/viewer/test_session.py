"""Sessions: the newest request is answered, first coarsely, then exactly; what fails is said."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.viewer import session as session_module
from ssgi_cl.viewer.light_settings import LightState, with_power
from ssgi_cl.viewer.outputs import ERROR, OUTPUTS
from ssgi_cl.viewer.render_loop import RenderLoop
from ssgi_cl.viewer.settings import AO, FRAME
from ssgi_cl.viewer.source import Source, gbuffer_source

from .conftest import SIZE, Watched

Watch = Callable[..., Watched]


def test_the_first_still_picture_is_that_of_render(box: Source, watch: Watch, runtime: Runtime) -> None:
    watched = watch(box)
    still = watched.until_still()
    assert [shown.moving for shown in watched.shown] == [True, True, False]
    assert box.scene is not None
    frame = gi.render(box.scene, box.pose.camera(*SIZE), box.lights, runtime=runtime)
    np.testing.assert_array_equal(still.picture, frame.image)
    assert watched.error == ""


def test_a_still_picture_is_refined_and_then_left_alone(
    runtime: Runtime, box: Source, watch: Watch, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_module, "REST", 0.0)
    watched = watch(box)
    first = watched.until_still().picture
    while watched.session.step() is not None:
        pass
    last = watched.shown[-1]
    assert "mean of 16 frames" in last.note
    # The same light within noise of samples, but smooth edges: both differ from the first by less than 3 of 255.
    assert 0.0 < np.abs(last.picture.astype(float) - first).mean() < 3.0
    assert box.scene is not None
    _, drawn = watched.session.still()
    samples = gi.render(box.scene, box.pose.camera(*SIZE), box.lights, samples=16, edges=7, runtime=runtime)
    assert drawn is not None
    assert drawn.values is not None
    # The same frames in the same order, added up alike.
    np.testing.assert_array_equal(drawn.values, samples.radiance)


def test_only_the_newest_request_is_drawn(box: Source, watch: Watch) -> None:
    watched = watch(box)
    watched.until_still()
    count = len(watched.shown)
    for step in range(200):
        last = watched.session.change(pose=replace(box.pose, eye=(0.278, 0.273, -0.8 + 1e-3 * step)))
    watched.session.step()
    assert len(watched.shown) == count + 1
    assert watched.shown[-1].answers == last


@pytest.mark.parametrize("name", [name for name in OUTPUTS if name != "picture"])
def test_every_output_is_drawn(box: Source, watch: Watch, name: str) -> None:
    watched = watch(box)
    settings = watched.session.look.settings.changed(AO, "radius", 0.2)  # the frame's own is below a pixel here
    watched.session.change(output=name, settings=settings)
    still = watched.until_still()
    assert watched.error == ""
    assert still.picture.shape == (*SIZE[::-1], 3)
    if name not in ("sky", "reflections"):  # the box has neither a sky nor gloss
        assert still.picture.std() > 1.0


def test_an_error_is_said_and_the_next_look_is_drawn(box: Source, watch: Watch) -> None:
    watched = watch(box)
    watched.until_still()
    watched.session.change(output="no such output")
    assert watched.session.step() is None
    assert "no such output" in watched.error
    watched.session.change(output="depth")
    watched.until_still()
    assert watched.error == ""


def test_a_scene_without_room_is_said(
    box: Source, watch: Watch, runtime: Runtime, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched = watch(box, (640, 480))
    with monkeypatch.context() as patch:
        patch.setattr(runtime.memory, "limit", 1 << 20)
        watched.session.step()
        assert "no room for" in watched.error
    watched.session.change()
    watched.until_still()
    assert watched.error == ""


def test_a_closed_session_frees_its_memory(box: Source, watch: Watch, runtime: Runtime) -> None:
    one = watch(box)
    one.until_still()
    gc.collect()
    before = runtime.memory.used
    other = watch(box, (160, 120))
    other.until_still()
    assert runtime.memory.used > before
    other.session.close()
    other.shown.clear()
    gc.collect()
    # What is kept for all callers, such as tone mapping of a size, may stay; renderers are megabytes.
    assert runtime.memory.used - before < 1 << 20


def test_two_sessions_see_their_own_cameras(box: Source, watch: Watch) -> None:
    loop = RenderLoop()
    one, other = watch(box), watch(box)
    other.session.change(pose=replace(box.pose, eye=(0.4, 0.4, -0.6)))
    for each in (one, other):
        each.session._wake = loop.wake
        loop.add(each.session)
    deadline = time.monotonic() + 60.0
    while not all(each.shown and not each.shown[-1].moving for each in (one, other)):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    loop.end()
    assert (one.shown[-1].picture != other.shown[-1].picture).any()


def test_a_flood_of_changes_from_threads_is_answered_by_the_last(box: Source, watch: Watch) -> None:
    watched = watch(box)
    loop = RenderLoop()
    watched.session._wake = loop.wake
    loop.add(watched.session)

    def flood() -> None:
        for step in range(500):
            watched.session.change(wipe=step / 500.0)

    threads = [threading.Thread(target=flood) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    last = watched.session.change(output="normals")
    deadline = time.monotonic() + 60.0
    while not watched.shown or watched.shown[-1].answers != last or watched.shown[-1].moving:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    loop.end()
    assert len(watched.shown) < 500  # of 2001 requests
    assert watched.error == ""


def test_the_wipe_shows_both_sides(box: Source, watch: Watch) -> None:
    watched = watch(box)
    dark = tuple(LightState(light=state.light, on=False) for state in watched.session.look.lights)
    settings = watched.session.look.settings.changed(FRAME, "exposure", 1e-3)
    other = replace(watched.session.look, settings=settings, lights=dark)
    watched.session.change(other=other, against="B", wipe=0.5)
    picture = watched.until_still().picture
    middle = SIZE[0] // 2
    assert picture[:, : middle - 1].mean() > 20.0
    assert picture[:, middle + 1 :].mean() < 5.0
    watched.session.change(wipe=1.0)
    assert watched.until_still().picture[:, middle + 1 : -8].mean() > 20.0


def test_the_error_needs_a_reference_and_then_has_figures(box: Source, watch: Watch) -> None:
    pytest.importorskip("mitsuba")
    watched = watch(box, (48, 32))
    watched.session.change(output=ERROR)
    assert "no reference of this view" in watched.until_still().note
    watched.session.start_reference()
    reference = watched.session.reference
    assert reference is not None
    deadline = time.monotonic() + 120.0
    while reference.latest is None or reference.latest[2] < 8:
        assert reference.state == "running"
        assert time.monotonic() < deadline
        time.sleep(0.05)
    watched.session.stop_reference()
    reference.join(60.0)
    assert reference.state == "stopped"
    watched.session.change(output=ERROR)
    note = watched.until_still().note
    assert "RMSE" in note
    assert "of which the reference has" in note
    watched.session.change(pose=replace(box.pose, eye=(0.4, 0.4, -0.6)))
    assert "no reference of this view" in watched.until_still().note


def test_brighter_lights_are_seen(watch: Watch, runtime: Runtime) -> None:
    from ssgi_cl.viewer.source import open_source

    workshop = open_source("workshop", runtime)
    watched = watch(workshop)
    watched.session.change(settings=watched.session.look.settings.changed(FRAME, "exposure", 0.05))
    before = watched.until_still().picture.mean()
    lights = tuple(replace(s, light=with_power(s.light, 4.0 * _power(s))) for s in watched.session.look.lights)
    watched.session.change(lights=lights)
    assert watched.until_still().picture.mean() > before + 2.0


def _power(state: LightState) -> float:
    from ssgi_cl.viewer.light_settings import power_of

    return power_of(state.light)


def test_a_gbuffer_is_shown_by_its_own_camera(box: Source, watch: Watch, runtime: Runtime) -> None:
    assert box.scene is not None
    gbuffer = gi.rasterize.gbuffer(box.scene, box.pose.camera(64, 48), runtime=runtime)
    watched = watch(gbuffer_source("box", gbuffer), (64, 48))
    for name, output in OUTPUTS.items():
        watched.session.change(output=name)
        watched.session.step()
        if output.of_gbuffer:
            assert watched.error == "", name
            assert watched.shown[-1].picture.shape == (48, 64, 3)
        else:
            assert "a G-buffer has none" in watched.error
    with pytest.raises(ValueError, match="a G-buffer has no reference"):
        watched.session.start_reference()
