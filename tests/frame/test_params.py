"""Parameters are resources of the frame graph: what reads none that changed is reused."""

from __future__ import annotations

import ssgi_cl as gi
from ssgi_cl.device.runtime import Runtime
from ssgi_cl.rasterize.scenes import make_scene


def test_another_radius_runs_occlusion_and_what_reads_it(runtime: Runtime) -> None:
    view = make_scene("cornell_box")
    camera = gi.Camera.look_at(view.eye, view.target, view.up, yfov=view.yfov, width=48, height=36)
    lights = [*view.lights, gi.Environment((0.3, 0.4, 0.5))]

    def states(radius: float) -> dict[str, str]:
        frame = gi.render(
            view.scene,
            camera,
            lights,
            indirect="multires",
            vpls=64,
            ao_radius=radius,
            shadow_size=32,
            rsm_size=32,
            exposure=1.0,
            runtime=runtime,
        )
        return {stage.name: stage.state for stage in frame.graph.stages}

    states(0.3)
    same = states(0.3)
    other = states(0.6)
    assert "ran" not in {same[name] for name in ("G-buffer", "gtao", "bounce", "combine")}
    for name in ("G-buffer", "direct light", "bounce"):
        assert other[name] == "reused", name
    assert other["gtao"] == other["combine"] == "ran"
