"""Whether the default frame beats a denoised path tracer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .measure import Row, peer_name
from .modes import DEFAULT

SHARE = 1.0 / 3.0
"""Of the peer's time that the frame may take."""
PEER = peer_name(1, denoised=True)


@dataclass(frozen=True)
class Verdict:
    """What the rows of a scene say.

    Attributes:
        reached: lower FLIP than the peer in at most a third of its time; None without both rows.
        text: the same in a line.
    """

    reached: bool | None
    text: str


def verdict(rows: Sequence[Row]) -> Verdict:
    """Compare the default frame with one path and OIDN, both with scene and lights kept."""
    found = {row.name: row for row in rows}
    ours, peer = found.get(DEFAULT), found.get(PEER)
    if ours is None or peer is None:
        return Verdict(None, f"not judged: {DEFAULT if ours is None else PEER} was not measured")
    time = ours.kept_ms / peer.kept_ms
    closer, faster = ours.error.flip < peer.error.flip, time <= SHARE
    text = (
        f"default: FLIP {ours.error.flip:.3f} {'<' if closer else '>='} {peer.error.flip:.3f} of "
        f"{PEER}, in {time:.2f} of its time ({'at most' if faster else 'more than'} a third)"
    )
    return Verdict(closer and faster, f"{'reached' if closer and faster else 'missed'}; {text}")
