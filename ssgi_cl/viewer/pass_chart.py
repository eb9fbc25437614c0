"""Time and memory of the stages of a frame as bars, in HTML."""

from __future__ import annotations

from html import escape

from ssgi_cl.frame.record import GraphRecord

_ROW = (
    '<div style="display:flex;align-items:center;gap:4px;font-size:11px;line-height:16px" title="{title}">'
    '<span style="width:40%;overflow:hidden;text-overflow:ellipsis;white-space:nowrap">{name}</span>'
    '<span style="flex:1"><span style="display:block;height:9px;width:{share:.1f}%;background:{colour}"></span></span>'
    '<span style="width:30%;text-align:right;font-variant-numeric:tabular-nums">{figure}</span></div>'
)
_RAN, _REUSED = "#3b82f6", "#9ca3af"


def chart(record: GraphRecord, wall_ms: float) -> str:
    """Return the stages that ran, with milliseconds on the device and device memory of what they write.

    A line each says what was reused and what had nothing to do.

    The rest of the wall-clock time is the host's: read-back, and preparation of what a scene or light needs once.
    """
    ran = [stage for stage in record.stages if stage.state == "ran"]
    longest = max((stage.ms for stage in ran), default=0.0) or 1.0
    rows = []
    for stage in ran:
        memory = sum(record.sizes.get(name, 0) for name in stage.writes) / 2**20
        figure = f"{stage.ms:.1f} ms" + (f", {memory:.1f} MiB" if memory >= 0.05 else "")
        kernels = ", ".join(f"{name} x {count}: {ms:.2f} ms" for name, (count, ms) in stage.kernels.items())
        rows.append(_row(stage.name, 100.0 * stage.ms / longest, figure, _RAN, kernels))
    for state in ("reused", "idle"):
        names = [stage for stage in record.stages if stage.state == state]
        if names:
            why = "; ".join(f"{stage.name}: {stage.why}" for stage in names)
            rows.append(_row(f"{state}: {', '.join(stage.name for stage in names)}", 0.0, "", _REUSED, why))
    used, peak = (record.memory.get(name, 0) / 2**20 for name in ("used", "peak"))
    head = f"{wall_ms:.0f} ms, {record.ms:.0f} on the device; memory {used:.0f} MiB (at most {peak:.0f} MiB so far)"
    return f'<div style="padding:4px 10px"><div style="font-size:12px">{escape(head)}</div>{"".join(rows)}</div>'


def _row(name: str, share: float, figure: str, colour: str, title: str) -> str:
    return _ROW.format(
        title=escape(title, quote=True), name=escape(name), share=share, figure=escape(figure), colour=colour
    )
