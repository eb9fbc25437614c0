"""Batches of G-buffers of one size: techniques take one and return results with a leading axis."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ssgi_cl.core.array_kinds import ArrayKind, host_array

if TYPE_CHECKING:
    from ssgi_cl.core.gbuffer import GBuffer


class GBufferBatch(Sequence["GBuffer"]):
    """G-buffers of equal size, margin and layers.

    Every technique takes a batch in place of a G-buffer; its results are [images, rows, columns] and
    [images, rows, columns, channels].

    Args:
        gbuffers: at least one.

    Attributes:
        array_kind: of the results, see `GBuffer`; that of the first.

    Raises:
        ValueError: none, or of different sizes.
    """

    def __init__(self, gbuffers: Iterable[GBuffer]) -> None:
        self._gbuffers = tuple(gbuffers)
        if not self._gbuffers:
            raise ValueError("gbuffers is empty: expected at least one G-buffer")
        first = self._gbuffers[0]
        self.array_kind: ArrayKind | None = first.array_kind
        for number, each in enumerate(self._gbuffers):
            if (each.size, each.margin, each.layers) != (first.size, first.margin, first.layers):
                raise ValueError(
                    f"gbuffers[{number}] has size {each.size}, margin {each.margin} and {each.layers} layers: "
                    f"expected {first.size}, {first.margin} and {first.layers} as the first"
                )

    @property
    def size(self) -> tuple[int, int]:
        """(rows, columns) of each image."""
        return self._gbuffers[0].size

    def __len__(self) -> int:
        return len(self._gbuffers)

    def __getitem__(self, index: Any) -> Any:
        chosen = self._gbuffers[index]
        return GBufferBatch(chosen) if isinstance(index, slice) else chosen

    def __iter__(self) -> Iterator[GBuffer]:
        return iter(self._gbuffers)

    def __repr__(self) -> str:
        return f"GBufferBatch of {len(self)}, each {self._gbuffers[0]!r}"


def images_in(args: Sequence[Any], kwargs: Mapping[str, Any]) -> int | None:
    """Return the number of images in the batch among arguments; None if there is none."""
    return next((len(each) for each in (*args, *kwargs.values()) if isinstance(each, GBufferBatch)), None)


def image_by_image(function: Callable[..., Any], count: int, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
    """Return the results of a function for each image of a batch, stacked.

    Batches and arrays among the arguments are [images, ...]; all else is the same for every image.

    Raises:
        ValueError: an array of another number of images.
    """
    stacked: Any = None
    for number in range(count):
        result = function(
            *(_part(f"argument {place}", each, count, number) for place, each in enumerate(args, 1)),
            **{name: _part(name, each, count, number) for name, each in kwargs.items()},
        )
        stacked = _stacked(stacked, result, count, number)
    return stacked


def _part(name: str, value: Any, count: int, number: int) -> Any:
    """Return the part of an argument that belongs to an image."""
    if not isinstance(value, (GBufferBatch, np.ndarray, memoryview)) and not hasattr(value, "__dlpack__"):
        return value
    batch = value if isinstance(value, GBufferBatch) else host_array(value)
    if len(batch) != count:
        raise ValueError(f"{name} holds {len(batch)} images: expected {count} as the G-buffers")
    return batch[number]


def _stacked(stacked: Any, result: Any, count: int, number: int) -> Any:
    """Add the result for an image to those for all: arrays become rows of one, other results a list."""
    if isinstance(result, tuple):
        before = stacked or (None,) * len(result)
        parts = [_stacked(*each, count, number) for each in zip(before, result, strict=True)]
        return type(result)(*parts) if hasattr(result, "_fields") else tuple(parts)
    if not isinstance(result, np.ndarray):
        return [*(stacked or ()), result]
    if stacked is None:
        stacked = np.empty((count, *result.shape), result.dtype)
    stacked[number] = result
    return stacked
