"""The scenes that parameters are tuned on, validated with and reported on, with their truths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ssgi_cl.device.arrays import Size
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import REPORTED, TUNED_ON, TUNING_SEEDS, VALIDATED_ON, VALIDATION_SEEDS, BuiltinScene
from ssgi_cl.techniques.technique import Technique
from ssgi_cl.tuning.context import Context, Progress, TruthSettings
from ssgi_cl.tuning.measured_scenes import views_of
from ssgi_cl.tuning.trials import Trials

SETS = ("tuning", "validation", "reporting")
"""The set that decides, the one that confirms, and the one that is only shown."""

SIZE = (240, 320)
"""Of the pictures."""

RAYS = 256
"""Of the truths, per pixel: their standard error is about a tenth of what techniques err."""

OVERSCAN = 0.1
"""Of the G-buffers."""

MESH_VIEWS = ("sponza", "country_kitchen", "veach_ajar")
"""Names of the views of meshes that errors are reported on, files in docs/views."""

VIEWS = Path(__file__).resolve().parent.parent / "docs" / "views"


class SceneSets:
    """One view of each scene of each set.

    Args:
        runtime: the device.
        meshes: the folder of the meshes of `MESH_VIEWS`; without, `REPORTED` alone is reported on.
        chosen: name of a set -> its scenes, in place of the usual ones.
        size: (rows, columns) of the pictures.
        rays: of the truths, per pixel.
        kinds: of generated scenes to tune on and validate with, in place of those of the presets.
        progress: called with what is under way and the share of it that is done.

    Attributes:
        views, contexts: name of a set -> its views, and the same with what is shared of each.
    """

    def __init__(
        self,
        runtime: Runtime,
        *,
        meshes: Path | None = None,
        chosen: Mapping[str, Sequence[BuiltinScene]] | None = None,
        size: Size = SIZE,
        rays: int = RAYS,
        kinds: Sequence[str] | None = None,
        progress: Progress | None = None,
    ) -> None:
        files = [] if meshes is None else [str(VIEWS / f"{name}.json") for name in MESH_VIEWS]
        names: dict[str, Sequence[str]] = {
            "tuning": TUNED_ON,
            "validation": VALIDATED_ON,
            "reporting": (*REPORTED, *files),
        }
        if kinds is not None:
            for name, seeds in (("tuning", TUNING_SEEDS), ("validation", VALIDATION_SEEDS)):
                names[name] = tuple(f"{kind}-{seed}" for kind in kinds for seed in seeds)
        self.runtime, self.size = runtime, size
        self.truth = TruthSettings(rays=rays)
        self.views: dict[str, list[BuiltinScene]] = {}
        self.contexts: dict[str, list[Context]] = {}
        for number, name in enumerate(SETS):
            if progress is not None:
                progress(f"scenes for {name}", number / len(SETS))
            made = views_of(names[name], runtime, meshes).values() if chosen is None else chosen[name]
            self.views[name] = [scene.views()[0] for scene in made]
            self.contexts[name] = [Context(runtime, view, size, self.truth) for view in self.views[name]]
            for context in self.contexts[name]:
                context.progress = progress or context.progress

    def trials(self, entry: Technique, layers: int, overscan: float = OVERSCAN) -> dict[str, Trials]:
        """Return the trials of a technique on each set, with all truths made."""
        found = {}
        for name, contexts in self.contexts.items():
            found[name] = Trials(entry, contexts, {}, "rmse", layers, overscan)
            found[name].prepare()
        return found

    def errors(self, trials: Mapping[str, Trials], setting: Mapping[str, object], of: str) -> dict[str, float]:
        """Return the RMSE of a setting on each scene of a set, by the scene's name."""
        return {view.name: error for view, error in zip(self.views[of], trials[of].errors(setting), strict=True)}
