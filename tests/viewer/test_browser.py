"""The page in a real browser: Debian's Chromium with software WebGL. Screenshots are kept in build/window."""

from __future__ import annotations

import io
import os
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("viser", reason="the extra viewer is not installed")
playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")

from ssgi_cl.core.lights import SpotLight  # noqa: E402
from ssgi_cl.device.runtime import Runtime  # noqa: E402
from ssgi_cl.viewer.server import Viewer  # noqa: E402
from ssgi_cl.viewer.tab import Tab  # noqa: E402
from ssgi_cl.viewer.view import view  # noqa: E402

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SHOTS = Path(__file__).parents[2] / "build" / "window"
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
PATIENCE = 60.0
"""Seconds: machines of tests are busy."""
WIDTH, HEIGHT = 960, 600

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning", "ignore:Queued a"),
]


class Page:
    """A tab in the browser, and its other end in this process."""

    def __init__(self, window: Viewer, page: Any) -> None:
        before = window.tabs
        self.page, self.window = page, window
        page.goto(window.url)
        self.wait(lambda: len(window.tabs) > len(before), "no tab was opened")
        self.tab: Tab = next(tab for tab in window.tabs if tab not in before)

    def wait(self, ready: Callable[[], bool], why: str) -> None:
        deadline = time.monotonic() + PATIENCE
        while not ready():
            assert time.monotonic() < deadline, why
            self.page.wait_for_timeout(20)

    def still(self, change: int | None = None) -> None:
        """Wait until the browser has the still picture of the newest look."""

        def there() -> bool:
            latest = self.tab._outlet.latest
            newest = self.tab.session._asked
            done = latest is not None and not latest.moving and latest.answers == newest
            return done and (change is None or newest > change)

        self.wait(there, f"no still picture came: {self.tab._said}")
        self.page.wait_for_timeout(250)  # JPEG is decoded and drawn

    def shot(self, name: str) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """Return what is seen left of the controls; keep it."""
        SHOTS.mkdir(parents=True, exist_ok=True)
        data = self.page.screenshot()
        (SHOTS / f"{name}.png").write_bytes(data)
        with Image.open(io.BytesIO(data)) as image:
            return np.asarray(image.convert("RGB"))[160:, : WIDTH // 2]

    def open(self, tab: str) -> None:
        self.page.get_by_role("tab", name=tab, exact=True).click()
        self.page.wait_for_timeout(100)


def _differ(one: np.ndarray, other: np.ndarray) -> float:
    """Return the mean difference of two screenshots, of 255."""
    return float(np.abs(one.astype(float) - other.astype(float)).mean())


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as player:
        started = player.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield started
        started.close()


@pytest.fixture(scope="module")
def window(runtime: Runtime) -> Iterator[Viewer]:
    os.environ.setdefault("NO_PROXY", "localhost,127.0.0.1")
    opened = view("workshop", port=8300, runtime=runtime)
    yield opened
    opened.close()


@pytest.fixture
def page(browser: Any, window: Viewer) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": WIDTH, "height": HEIGHT})
    one = Page(window, context.new_page())
    one.still()
    yield one
    count = len(window.tabs)
    context.close()
    deadline = time.monotonic() + PATIENCE
    while len(window.tabs) >= count and time.monotonic() < deadline:
        time.sleep(0.05)
    assert len(window.tabs) < count, "a closed tab stays"


def test_the_page_shows_the_scene_and_the_camera_orbits(page: Page) -> None:
    before = page.shot("loaded")
    assert before.std() > 10.0  # something is seen
    pose = page.tab.session.look.pose
    page.page.mouse.move(250, 400)
    page.page.mouse.down()
    page.page.mouse.move(230, 395, steps=8)
    page.page.mouse.up()
    page.wait(lambda: page.tab.session.look.pose != pose, "the camera did not move")
    page.page.wait_for_timeout(500)  # the camera swings out
    page.still()
    assert page.tab.session.look.pose.target == pytest.approx(pose.target, abs=1e-3)
    after = page.shot("orbited")
    assert _differ(before, after) > 3.0
    assert after.std() > 10.0, page.tab.session.look.pose


def test_a_slider_changes_the_picture_and_a_value_out_of_range_is_text(page: Page) -> None:
    before = page.shot("exposure-before")
    # By the mouse: arrow keys turn the camera too, wherever the focus is.
    thumb = page.page.get_by_role("slider").first.bounding_box()
    page.page.mouse.move(thumb["x"] + thumb["width"] / 2, thumb["y"] + thumb["height"] / 2)
    page.page.mouse.down()
    page.page.mouse.move(thumb["x"] - 30, thumb["y"] + thumb["height"] / 2, steps=5)
    page.page.mouse.up()
    page.wait(lambda: page.tab._settings().params.exposure is not None, "the slider did nothing")
    page.still()
    after = page.shot("exposure-after")
    assert after.mean() < before.mean() - 10.0
    # No widget sends it; a client that floods or lies may.
    control = next(c for c in _controls(page) if c.name == "layers")
    page.tab._panel.change("frame", control, 99)
    alert = page.page.get_by_role("alert").filter(has_text="layers is 99")
    alert.wait_for(timeout=1e3 * PATIENCE)
    page.shot("error")
    assert "expected" in alert.inner_text()
    page.tab._panel.change("frame", control, 1)
    alert.wait_for(state="detached", timeout=1e3 * PATIENCE)


def _controls(page: Page) -> Any:
    from ssgi_cl.viewer.controls import controls

    return controls(page.tab._settings().params, 0.1)


@pytest.mark.slow
def test_a_choice_makes_other_controls(page: Page) -> None:
    page.open("Settings")
    page.page.get_by_text("Ambient occlusion: gtao").wait_for(timeout=1e3 * PATIENCE)
    page.page.get_by_role("combobox", name="ao", exact=True).click()
    page.page.get_by_role("option", name="ssao", exact=True).click()
    page.page.get_by_text("Ambient occlusion: ssao").wait_for(timeout=1e3 * PATIENCE)
    page.still()
    page.shot("settings")
    assert page.tab._settings().params.ao_name == "ssao"
    assert not any(page.tab._said.values())


@pytest.mark.slow
def test_a_light_is_dragged_in_the_scene(page: Page) -> None:
    lights = page.tab.session.look.lights
    index = next(i for i, state in enumerate(lights) if isinstance(state.light, SpotLight))
    place = np.asarray(lights[index].light.position)
    page.open("Lights")
    page.page.get_by_label("handles").check()
    # Look at the handle from nearby, along -z: its x axis then runs across the picture.
    pose = page.tab.session.look.pose
    eye = place + np.array([0.0, 0.0, 0.25 * page.window.source.extent])
    page.tab.look_from(type(pose)(eye=tuple(eye), target=tuple(place), up=pose.up, yfov=pose.yfov))
    page.page.wait_for_timeout(1500)
    page.still()
    before = page.shot("light-before")
    middle = WIDTH / 2, HEIGHT / 2
    scale = _pixels_per_unit(page)
    page.page.mouse.move(middle[0] + 0.5 * scale, middle[1])
    page.page.wait_for_timeout(300)
    page.page.mouse.down()
    page.page.mouse.move(middle[0] - 40, middle[1], steps=10)
    page.page.wait_for_timeout(300)
    page.page.mouse.up()
    page.still()
    now = np.asarray(page.tab.session.look.lights[index].light.position)
    after = page.shot("light-after")
    assert np.linalg.norm(now - place) > 1e-3 * page.window.source.extent, "the handle was not caught"
    assert _differ(before, after) > 0.5


def _pixels_per_unit(page: Page) -> float:
    """Return the length of a handle's axis in the picture, pixels."""
    from ssgi_cl.viewer.light_panel import _HANDLE_SHARE

    look = page.tab.session.look
    distance = 0.25 * page.window.source.extent
    return _HANDLE_SHARE * page.window.source.extent / distance * 0.5 * HEIGHT / np.tan(0.5 * look.pose.yfov)


@pytest.mark.slow
def test_the_wipe_moves(page: Page) -> None:
    page.open("Compare")
    page.page.get_by_role("button", name="Keep this as B").click()
    page.wait(lambda: page.tab.session.look.other is not None, "nothing was kept")
    page.tab.session.change(settings=page.tab._settings().changed("frame", "exposure", 1e-3))
    page.still()
    half = page.shot("wipe-half")
    slider = page.page.get_by_role("slider").first
    slider.focus()
    change = page.tab.session._asked
    slider.press("Home")  # all of it is B
    page.still(change)
    assert page.tab.session.look.wipe == 0.0
    whole = page.shot("wipe-whole")
    assert half.mean() < 30.0 < whole.mean()


@pytest.mark.slow
def test_a_reference_is_made_and_stopped(page: Page) -> None:
    pytest.importorskip("mitsuba")
    page.tab._width = 320
    page.tab.session.change(size=page.tab._size())
    page.still()
    page.open("Compare")
    page.page.get_by_role("button", name="Start the reference").click()
    page.page.get_by_text("standard error").first.wait_for(timeout=1e3 * PATIENCE)
    page.page.get_by_role("button", name="Stop the reference").click()
    page.page.get_by_text("stopped").first.wait_for(timeout=1e3 * PATIENCE)
    page.tab.session.change(output="error")
    page.page.get_by_text("RMSE").wait_for(timeout=1e3 * PATIENCE)
    page.shot("error-against-reference")


@pytest.mark.slow
def test_cost_code_and_downloads(page: Page) -> None:
    page.open("Cost")
    page.page.get_by_text("G-buffer").first.wait_for(timeout=1e3 * PATIENCE)
    page.shot("cost")
    page.open("Code")
    page.page.get_by_text("gi.Camera.look_at").first.wait_for(timeout=1e3 * PATIENCE)
    page.shot("code")
    page.open("View")
    for label, start in (("Save as PNG", b"\x89PNG"), ("Save as EXR", b"\x76\x2f\x31\x01")):
        with page.page.expect_download(timeout=1e3 * PATIENCE) as caught:
            page.page.get_by_role("button", name=label).click()
        assert Path(caught.value.path()).read_bytes().startswith(start)


@pytest.mark.slow
def test_two_tabs_have_their_own_cameras_and_no_share_button(browser: Any, page: Page, window: Viewer) -> None:
    context = browser.new_context(viewport={"width": WIDTH, "height": HEIGHT})
    other = Page(window, context.new_page())
    other.still()
    pose = page.tab.session.look.pose
    other.tab.look_from(type(pose)(eye=(0.5, 1.0, 0.5), target=pose.target, up=pose.up, yfov=pose.yfov))
    other.wait(lambda: other.tab.session.look.pose.eye[0] == pytest.approx(0.5, abs=1e-3), "it did not move")
    other.still()
    assert page.tab.session.look.pose == pose
    assert window._server.request_share_url() is None
    context.close()


@pytest.mark.slow
def test_a_file_that_vanished_is_text_in_the_page(browser: Any, runtime: Runtime, tmp_path: Path) -> None:
    path = tmp_path / "corner.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\nf 1 4 2\n")
    window = view(path, port=8350, runtime=runtime)
    context = browser.new_context(viewport={"width": WIDTH, "height": HEIGHT})
    page = Page(window, context.new_page())
    page.still()
    path.unlink()
    page.page.get_by_role("button", name="Read the file again").click()
    alert = page.page.get_by_role("alert").filter(has_text="corner.obj")
    alert.wait_for(timeout=1e3 * PATIENCE)
    page.shot("vanished")
    path.write_text("v 0 0 0\nv 2 0 0\nv 0 2 0\nf 1 2 3\n")
    page.page.get_by_role("button", name="Read the file again").click()
    alert.wait_for(state="detached", timeout=1e3 * PATIENCE)
    page.still()
    context.close()
    window.close()
