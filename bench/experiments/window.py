"""Times and memory of the window without a browser: `python -m ssgi_cl.bench.experiments.window --help`."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from dataclasses import replace
from typing import Any

import click
import numpy as np
from PIL import Image

from ssgi_cl.device.runtime import Runtime
from ssgi_cl.viewer.light_settings import LightState, moved, power_of, with_power
from ssgi_cl.viewer.look import Look
from ssgi_cl.viewer.outlet import MOVING_QUALITY
from ssgi_cl.viewer.render_loop import RenderLoop
from ssgi_cl.viewer.session import Session, Shown
from ssgi_cl.viewer.settings import AO, FRAME, Settings
from ssgi_cl.viewer.source import open_source

SIZE = 640, 400
FIRST = """
import time
begin = time.time() - float(open("/proc/uptime").read().split()[0])
from ssgi_cl.bench.experiments.window import Stand
stand = Stand({scene!r})
stand.wait(lambda: stand.shown)
ticks = int(open("/proc/self/stat").read().split()[21])
print(time.time() - begin - ticks / 100.0)
"""
"""Seconds from the start of the process to the first picture."""


class Stand:
    """A session in the loop that keeps when each change was answered, encoded as for the page."""

    def __init__(self, scene: str) -> None:
        runtime = Runtime.open()
        self.source = open_source(scene, runtime)
        look = Look(
            pose=self.source.pose,
            size=SIZE,
            settings=Settings(self.source.radius),
            lights=tuple(LightState(light=light) for light in self.source.lights),
        )
        self.shown: list[tuple[float, Shown]] = []
        self.errors: list[str] = []
        self.runtime = runtime
        self.loop = RenderLoop()
        self.session = Session(self.source, look, runtime, self._show, self._say, self.loop.wake)
        self._lock = threading.Lock()
        self.loop.add(self.session)

    def _show(self, shown: Shown) -> None:
        if shown.moving:
            Image.fromarray(shown.picture).tobytes("jpeg", "RGB", MOVING_QUALITY)
        # Pictures are kept small: the growth of memory is measured.
        self.shown.append((time.perf_counter(), replace(shown, picture=shown.picture[:1, :1].copy(), frame=None)))

    def _say(self, text: str) -> None:
        if text:
            self.errors.append(text)

    def wait(self, ready: Any, seconds: float = 120.0) -> None:
        """Wait until `ready()` is true."""
        deadline = time.perf_counter() + seconds
        while not ready():
            if time.perf_counter() > deadline:
                raise TimeoutError(f"nothing came in {seconds:g} s; errors: {self.errors}")
            time.sleep(0.001)

    def answer(self, change: int, *, still: bool = False) -> float:
        """Wait for the answer to a change; return when it came."""
        self.wait(
            lambda: self.shown and self.shown[-1][1].answers >= change and not (still and self.shown[-1][1].moving)
        )
        return next(at for at, shown in self.shown if shown.answers >= change and not (still and shown.moving))

    def rest(self) -> None:
        """Wait until the still picture is there and refined."""
        self.answer(self.session._asked, still=True)
        count = -1
        while count != len(self.shown):
            count = len(self.shown)
            time.sleep(1.5)

    def orbit(self, angle: float) -> int:
        """Turn the camera about its target; return the number of the change."""
        pose = self.source.pose
        eye, target = np.array(pose.eye), np.array(pose.target)
        cosine, sine = np.cos(angle), np.sin(angle)
        turned = target + np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]) @ (eye - target)
        return self.session.change(pose=replace(pose, eye=tuple(turned.tolist())))


def moving(stand: Stand, frames: int) -> dict[str, Any]:
    """Return the rate of pictures while the camera turns."""
    for step in range(20):  # sizes are chosen and prepared
        stand.answer(stand.orbit(0.01 * step))
    begin, times = time.perf_counter(), []
    for step in range(frames):
        last = time.perf_counter()
        stand.answer(stand.orbit(0.2 + 0.004 * step))
        times.append(time.perf_counter() - last)
    note = stand.shown[-1][1].note
    return {
        "frames a second": round(frames / (time.perf_counter() - begin), 1),
        "median ms": round(1e3 * float(np.median(times)), 1),
        "99 % ms": round(1e3 * float(np.quantile(times, 0.99)), 1),
        "size": note.split(",")[0],
    }


def _random_change(stand: Stand, rng: np.random.Generator) -> int:
    """Change something at random; return the number of the change."""
    session, look = stand.session, stand.session.look
    kind = rng.integers(5 if look.lights else 3)
    if kind == 0:
        return stand.orbit(float(rng.uniform(-0.5, 0.5)))
    if kind == 1:
        return session.change(settings=look.settings.changed(FRAME, "exposure", float(2.0 ** rng.uniform(-4, 2))))
    if kind == 2:
        return session.change(
            settings=look.settings.changed(AO, "radius", float(rng.uniform(0.1, 4) * stand.source.radius))
        )
    index = int(rng.integers(len(look.lights)))
    lights = list(look.lights)
    light = lights[index].light
    if kind == 3:
        power = power_of(stand.source.lights[index]) * float(rng.uniform(0.2, 2.0))
        lights[index] = replace(lights[index], light=with_power(light, power))
    elif hasattr(light, "position"):
        place = np.asarray(stand.source.lights[index].position) + rng.normal(0.0, 0.2, 3)  # type: ignore[union-attr]
        lights[index] = replace(lights[index], light=moved(light, place, np.zeros(3)))
    return session.change(lights=tuple(lights))


def sliders(stand: Stand, count: int, *, lights: bool = True) -> dict[str, Any]:
    """Return milliseconds to the answer of a slider that is moved while nothing else happens."""
    found: dict[str, list[float]] = {"exposure": [], "ao radius": [], "light's power": []}
    if not lights:
        del found["light's power"]
    for step in range(count + 1):
        for name, times in found.items():
            look = stand.session.look
            share = 1.0 + 0.05 * (step + 1)
            begin = time.perf_counter()
            if name == "exposure":
                change = stand.session.change(settings=look.settings.changed(FRAME, "exposure", 0.2 * share))
            elif name == "ao radius":
                change = stand.session.change(settings=look.settings.changed(AO, "radius", share * stand.source.radius))
            else:
                light = with_power(stand.source.lights[-1], share * power_of(stand.source.lights[-1]))
                change = stand.session.change(lights=(*look.lights[:-1], LightState(light=light)))
            taken = stand.answer(change) - begin
            if step:  # the first prepares
                times.append(1e3 * taken)
            stand.answer(change, still=True)
            time.sleep(0.05)
    return {
        name: {"median ms": round(float(np.median(t)), 1), "most ms": round(max(t), 1)} for name, t in found.items()
    }


def random_changes(stand: Stand, moves: int) -> dict[str, Any]:
    """Return what many random changes lead to."""
    rng = np.random.default_rng(1)
    begin, slowest, memory = time.perf_counter(), 0.0, []
    for move in range(moves):
        before = time.perf_counter()
        change = _random_change(stand, rng)
        if move % 5 == 0:  # the others are overtaken by the next
            slowest = max(slowest, stand.answer(change) - before)
        time.sleep(float(rng.uniform(0.0, 0.06)))
        if move % 50 == 49:
            memory.append((_resident(), stand.runtime.memory.used / 2**20))
    host, device = np.array(memory).T
    return {
        "errors": stand.errors,
        "slowest answer s": round(slowest, 2),
        "seconds": round(time.perf_counter() - begin, 1),
        "resident MiB every 50 moves": [round(each) for each in host],
        "device MiB every 50 moves": [round(each) for each in device],
    }


def _resident() -> float:
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096 / 2**20


@click.command()
@click.option("--scene", default="hall", show_default=True, help="A built-in scene or a file.")
@click.option("--moves", default=500, show_default=True, help="Random changes.")
def main(scene: str, moves: int) -> None:
    """Measure the window's pictures at 640 x 400: first one, while moving, after a slider, over many random changes."""
    firsts = []
    for _ in range(3):
        run = subprocess.run(
            [sys.executable, "-c", FIRST.format(scene=scene)], capture_output=True, text=True, check=True
        )
        firsts.append(round(float(run.stdout), 2))
    stand = Stand(scene)
    stand.rest()
    found = {"first picture s": firsts, "moving": moving(stand, 100)}
    stand.rest()
    found["sliders"] = sliders(stand, 10)
    found["random"] = random_changes(stand, moves)
    stand.loop.end()
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
