"""Ambient occlusion by the technique and setting that suit a preset, an error or a time: one call for all."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, TypedDict, Unpack, overload
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ssgi_cl.core import checks
from ssgi_cl.core.camera import Camera
from ssgi_cl.core.gbuffer import GBuffer
from ssgi_cl.core.names import Preset
from ssgi_cl.core.scene import Scene
from ssgi_cl.device.arrays import Size
from ssgi_cl.device.gbuffer import DeviceGBuffer
from ssgi_cl.device.runtime import Runtime, serialised
from ssgi_cl.rasterize.raster.rasterizer import Rasterizer
from ssgi_cl.rasterize.raster.view import device_scene, margin_of
from ssgi_cl.techniques import presets
from ssgi_cl.techniques.ao.bitmask import BitmaskAo
from ssgi_cl.techniques.ao.confidence import with_confidence
from ssgi_cl.techniques.ao.gtao import Gtao
from ssgi_cl.techniques.ao.occlusion import OcclusionTechnique, prepared_for, surfaces_on_device, without_thickness
from ssgi_cl.techniques.presets.choose import Choice, check_single, reaches, with_layers
from ssgi_cl.techniques.presets.front import OVERSCAN, SHARE, Option, drawn_options, every_option, front, named
from ssgi_cl.techniques.presets.speed_model import predicted_ms
from ssgi_cl.techniques.radius import sensible_radius

Floats = NDArray[np.float32]

TECHNIQUES: dict[str, type[OcclusionTechnique]] = {each.name: each for each in (Gtao, BitmaskAo)}

FILLED = 0.85
"""Share of a budget that the median of the measured calls may take: single calls take longer or shorter."""
RUNS = 5
"""Calls that are timed, after one that compiles and one that fills the caches."""
SOLID = 0.2
"""Share of a scene's area that bounds solids, from which on known ends are chosen from. Floors, walls and ground need
none; expected errors do not hold for leaves, few of which are solids (shares of less than .1)."""
HOPELESS = 4.0
"""Times the budget: what is predicted to take longer is not measured, and timed once if it is found to."""


class _Call(TypedDict, total=False):
    """Keywords of `ao`, but those that its types depend on."""

    preset: Preset | None
    error: float | None
    budget_ms: float | None
    scene: Scene | None
    camera: Camera | None
    runtime: Runtime | None


@overload
def ao(
    gbuffer: GBuffer | DeviceGBuffer | None = ...,
    radius: float | None = ...,
    *,
    confidence: Literal[False] = False,
    explain: Literal[False] = False,
    **asked: Unpack[_Call],
) -> Floats: ...
@overload
def ao(
    gbuffer: GBuffer | DeviceGBuffer | None = ...,
    radius: float | None = ...,
    *,
    confidence: Literal[True],
    explain: Literal[False] = False,
    **asked: Unpack[_Call],
) -> tuple[Floats, Floats]: ...
@overload
def ao(
    gbuffer: GBuffer | DeviceGBuffer | None = ...,
    radius: float | None = ...,
    *,
    confidence: Literal[False] = False,
    explain: Literal[True],
    **asked: Unpack[_Call],
) -> tuple[Floats, Choice]: ...
@overload
def ao(
    gbuffer: GBuffer | DeviceGBuffer | None = ...,
    radius: float | None = ...,
    *,
    confidence: Literal[True],
    explain: Literal[True],
    **asked: Unpack[_Call],
) -> tuple[Floats, Floats, Choice]: ...
@serialised
def ao(
    gbuffer: GBuffer | DeviceGBuffer | None = None,
    radius: float | None = None,
    *,
    preset: Preset | None = None,
    error: float | None = None,
    budget_ms: float | None = None,
    scene: Scene | None = None,
    camera: Camera | None = None,
    confidence: bool = False,
    explain: bool = False,
    runtime: Runtime | None = None,
) -> Floats | tuple[Floats | Choice, ...]:
    """Compute cosine-weighted ambient occlusion with the technique and the setting that suit a wish.

    The choice is among the recorded settings of `gtao` and `bitmask_ao`: slices, taps,
    resolution and blur. With a scene and its camera in place of a G-buffer, depth layers, overscan and
    whether the ends of solids are drawn are chosen too.

    Args:
        gbuffer: depth, and normals if there are any, with any layers and margin.
        radius: distance up to which surfaces occlude, scene units, > 0; by default 5 % of the picture's
            diagonal where surfaces are seen.
        preset: "low", "medium", "high" or "ultra": the least expected error in at most 1, 2.3, 4.5 or 32 times
            the device time of GTAO's defaults; of a scene, of those and of drawing one layer with overscan. By
            default "medium".
        error: RMSE against cast rays, > 0: the fastest setting that is expected to err no more. It is a
            geometric mean over recorded scenes: single ones err up to 2.3 times as much.
        budget_ms: milliseconds, > 0, of the wall clock from the call to its result in host memory: uploads,
            drawing and download count. Of the settings that keep it on this device, that of the least
            expected error is chosen. The first call for a size, a scene or a budget compiles and measures,
            which takes seconds; later ones use what it measured.
        scene, camera: what is drawn, in place of `gbuffer`.
        confidence: whether `ao_confidence` of A is returned too; its time is not part of the budget. Of a scene,
            thickness is drawn for it.
        explain: whether the choice is returned too.
        runtime: the device; by default the fastest found.

    Returns:
        A [rows, columns] float32 in [0, 1]: 1 = open, and where nothing is there. With `confidence`, then
        [rows, columns] float32 in [0, 1]: see `ao_confidence`. With `explain`, last the `Choice`: technique,
        parameters, layers, overscan, expected error, the time of the call if there is a budget, and why.

    Raises:
        TypeError, ValueError: an argument of the wrong type or out of range; more than one of `preset`,
            `error` and `budget_ms`; not either a G-buffer or a scene and its camera; an error or a budget
            that no setting keeps: the message says the least that one does.
    """
    asked = {"preset": preset, "error": error, "budget_ms": budget_ms}
    check_single(asked)
    checks.switch("confidence", confidence)
    checks.switch("explain", explain)
    if radius is not None:
        radius = checks.number("radius", radius, low=0.0, above=True, unit="scene units")
    if runtime is None:
        runtime = gbuffer.runtime if isinstance(gbuffer, DeviceGBuffer) else Runtime.open()
    source = _source(gbuffer, scene, camera, radius, runtime)
    choice: Choice
    if budget_ms is not None:
        choice = _within_budget(source, checks.number("budget_ms", budget_ms, low=0.0, above=True, unit="ms"))
    elif error is not None:
        choice = _to_error(source, checks.number("error", error, low=0.0, above=True))
    else:
        name = "medium" if preset is None else checks.choice("preset", preset, presets.NAMES)
        drawn = "" if gbuffer is not None else "drawing a layer and "
        why = f"preset {name!r}: the least expected error in {SHARE[name]:g} times the time of {drawn}GTAO's defaults"
        choice = _choice(source.named(name), source, why)
    found = source.computed(choice)
    results: tuple[Floats | Choice, ...] = (found,)
    if confidence:
        seen = gbuffer or source.surfaces(choice.layers, choice.overscan, thickness=True)
        results = with_confidence(found, seen, source.reach(choice, seen), runtime)
    if explain:
        results = (*results, choice)
    return results if len(results) > 1 else found


@dataclass(frozen=True, kw_only=True)
class _Source:
    """What occlusion is computed from.

    Attributes:
        gbuffer: given, or None.
        scene, camera: to be drawn, or None.
        radius: as it was given.
        runtime: the device.
        candidates: the recorded settings that may be chosen.
    """

    gbuffer: GBuffer | DeviceGBuffer | None
    scene: Scene | None
    camera: Camera | None
    radius: float | None
    runtime: Runtime
    candidates: tuple[Option, ...]

    @property
    def size(self) -> Size:
        """(rows, columns) of the image."""
        seen = self.camera or self.gbuffer
        assert seen is not None  # noqa: S101  one of both is given
        return seen.size

    def named(self, preset: str) -> Option:
        """Return the option of a preset."""
        return named(preset, self.candidates, drawn=self.scene is not None)

    def surfaces(self, layers: int, overscan: float, *, thickness: bool) -> DeviceGBuffer:
        """Return the G-buffer in device memory, uploaded or drawn now; its thickness is left out unless asked for."""
        if self.scene is None or self.camera is None:
            assert self.gbuffer is not None  # noqa: S101  one of both is given
            read = thickness or self.gbuffer.thickness is None
            return surfaces_on_device(self.gbuffer if read else without_thickness(self.gbuffer), self.runtime)
        margin = margin_of(self.camera, overscan)
        rasterizer: Rasterizer = self.runtime.prepared(
            (Rasterizer, "ao", self.size, layers, margin, thickness),
            lambda: Rasterizer(self.runtime, self.size, layers=layers, margin=margin, thickness=thickness),
        )
        with self.runtime.frame():
            target = rasterizer.render(device_scene(self.scene, self.runtime), self.camera)
            target.derive()
        return target

    def reach(self, choice: Choice, gbuffer: GBuffer | DeviceGBuffer) -> Any:
        """Return the radius of a choice: that which was given, or the default one of what is seen."""
        return choice.params.radius if self.radius is not None else sensible_radius(gbuffer)

    def computed(self, choice: Choice) -> Floats:
        """Return A of the choice's technique."""
        device = self.surfaces(choice.layers, choice.overscan, thickness=choice.thickness)
        params = type(choice.params)(**{**choice.parameters, "radius": self.reach(choice, device)})
        return prepared_for(TECHNIQUES[choice.technique], device, params)(device)


def _source(
    gbuffer: GBuffer | DeviceGBuffer | None,
    scene: Scene | None,
    camera: Camera | None,
    radius: float | None,
    runtime: Runtime,
) -> _Source:
    """Return what is given, checked."""
    if gbuffer is None:
        for name, value, kind in (("scene", scene, Scene), ("camera", camera, Camera)):
            if not isinstance(value, kind):
                raise TypeError(
                    f"{name} is {type(value).__name__}: expected a {kind.__name__}; or gbuffer, in place of scene and "
                    "camera"
                )
        assert scene is not None  # noqa: S101  that is checked above
        candidates = drawn_options(thickness=device_scene(scene, runtime).solid_share >= SOLID)
    else:
        for name, given in (("scene", scene), ("camera", camera)):
            if given is not None:
                raise ValueError(f"{name} is given beside gbuffer: expected either gbuffer, or scene and camera")
        radius = None if radius is None else sensible_radius(gbuffer, radius)
        if not isinstance(gbuffer, (GBuffer, DeviceGBuffer)):
            raise TypeError(f"gbuffer is {type(gbuffer).__name__}: expected GBuffer or DeviceGBuffer")
        whole = reaches(gbuffer.margin, gbuffer.size, OVERSCAN)
        known = gbuffer.thickness is not None
        candidates = every_option(gbuffer.layers, OVERSCAN if whole else 0.0, thickness=known)
    return _Source(
        gbuffer=gbuffer, scene=scene, camera=camera, radius=radius, runtime=runtime, candidates=tuple(candidates)
    )


def _choice(option: Option, source: _Source, why: str, wall_ms: float | None = None) -> Choice:
    given = {} if source.radius is None else {"radius": source.radius}
    return Choice(
        params=TECHNIQUES[option.technique].defaults(**option.parameters, **given),
        error=option.error,
        technique=option.technique,
        parameters=option.parameters,
        layers=option.layers,
        overscan=option.overscan,
        thickness=option.thickness,
        wall_ms=wall_ms,
        why=why,
    )


def _to_error(source: _Source, wanted: float) -> Choice:
    """Return the fastest option that is expected to reach an error, by recorded times alone."""

    def cost(option: Option) -> float:
        drawn = 0.0 if source.scene is None else option.drawn_ms
        return with_layers(option.technique, option.ms, option.layers) + drawn

    known = front(source.candidates, cost)
    chosen = next((option for option in known if option.error <= wanted), None)
    if chosen is None:
        layers = known[-1].layers
        raise ValueError(
            f"error is {wanted:g}: the best recorded setting, {known[-1]} with {layers} depth "
            f"layer{'s' if layers > 1 else ''}, is expected to reach {known[-1].error:.3f}"
        )
    return _choice(chosen, source, f"error {wanted:g}: the fastest recorded setting that is expected to reach it")


@dataclass(frozen=True)
class _Measured:
    """What a device takes for calls of a size: options of rising predicted time and falling error.

    Attributes:
        options: the front.
        predicted: of each, milliseconds.
        wall: of those measured, by their place in the front, milliseconds.
    """

    options: list[Option]
    predicted: list[float]
    wall: dict[int, float]


def _within_budget(source: _Source, budget: float) -> Choice:
    """Return the option of the least error whose calls were measured to keep a budget.

    It is searched for by halving the front: as later calls with other budgets halve it at the same places and use the
    same measurements, a larger budget never gets a larger error.
    """
    known = _measured(source)

    def took(place: int) -> float:
        if place not in known.wall:
            choice = _choice(known.options[place], source, "")
            known.wall[place] = _median_ms(partial(source.computed, choice), HOPELESS * budget)
        return known.wall[place]

    def keeps(place: int) -> bool:
        return known.predicted[place] <= HOPELESS * budget and took(place) <= FILLED * budget

    low, high = 0, len(known.options)
    while low < high:
        middle = (low + high) // 2
        if keeps(middle):
            low = middle + 1
        else:
            high = middle
    if low == 0:
        raise ValueError(
            f"budget_ms is {budget:g}: expected at least {_rounded_up(took(0) / FILLED):g} for {source.size[1]} x "
            f"{source.size[0]} pixels on this device: {known.options[0]}, the fastest, takes {took(0):.2g} ms with "
            f"{'transfers' if source.scene is None else 'drawing'}"
        )
    place = low - 1
    why = f"budget_ms {budget:g}: the whole call took {took(place):.3g} ms (median of {RUNS}); "
    if low == len(known.options):
        why += "it is the best that is recorded"
    else:
        better, measured = known.options[low], known.wall.get(low)
        ends = " and thickness" if better.thickness else ""
        time_of_it = f"takes about {known.predicted[low]:.3g} ms" if measured is None else f"took {measured:.3g} ms"
        why += f"the next better one, {better} with layers={better.layers}{ends}, {time_of_it}"
    return _choice(known.options[place], source, why, took(place))


_KNOWN: WeakKeyDictionary[Runtime, dict[tuple[Any, ...], _Measured]] = WeakKeyDictionary()
"""What is known of each device. `Runtime.prepared` would forget it after a budget that cannot be kept."""


def _measured(source: _Source) -> _Measured:
    """Return what is known of calls like this one; of the first, the front by predicted times.

    Calls are alike if G-buffers have the same size, layers and arrays, or scenes the same triangles, wherever these
    are, and if radii are alike within a factor of 2.
    """
    runtime, scene, given = source.runtime, source.scene, source.gbuffer
    reach = None if source.radius is None else math.frexp(source.radius)[1]
    key: tuple[Any, ...] = (source.size, reach)
    if scene is not None:
        every = max(1, len(scene.triangles) // 64)
        key += (len(scene.positions), len(scene.triangles), scene.triangles[::every].tobytes())
    elif isinstance(given, GBuffer):
        key += (given.margin, given.layers, given.normal is None, given.thickness is None)
    elif given is not None:
        key += (given.margin, given.layers, given.thickness is None, "on the device")
    known = _KNOWN.setdefault(runtime, {})
    if key not in known:
        sources: dict[tuple[int, float, bool], float] = {}

        def cost(option: Option) -> float:
            kind = (option.layers, option.overscan, option.thickness)
            if kind not in sources:
                sources[kind] = _median_ms(lambda: _finished(source, *kind))
            ms = with_layers(option.technique, option.ms, option.layers)
            return sources[kind] + predicted_ms(runtime, TECHNIQUES[option.technique], ms, source.size)

        chain = front(source.candidates, cost)
        known[key] = _Measured(chain, [cost(option) for option in chain], {})
    return known[key]


def _finished(source: _Source, layers: int, overscan: float, thickness: bool) -> None:
    """Draw or upload, and wait for it."""
    source.surfaces(layers, overscan, thickness=thickness)
    source.runtime.finish()


def _median_ms(run: Callable[[], object], enough_ms: float = math.inf) -> float:
    """Return the median wall time of some calls, after two that are not timed; of one that takes more than enough."""
    run()
    took: list[float] = []
    for _ in range(RUNS + 1):
        start = time.perf_counter()
        run()
        took.append(1e3 * (time.perf_counter() - start))
        if took[-1] > enough_ms:
            return took[-1]
    return statistics.median(took[1:])


def _rounded_up(value: float) -> float:
    """Return a number of milliseconds with two digits, no less than the value."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / step) * step:.3g}")
