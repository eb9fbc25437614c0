"""Errors that the library raises beyond ValueError and TypeError for bad arguments."""

from __future__ import annotations

import reprlib
from typing import Any

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 120


def shown(value: Any) -> str:
    """Return `value` as in Python code, cut short, for a message about what others wrote."""
    try:
        return _SHORT.repr(value)
    except ValueError:  # Python writes no integer of more than 4300 digits
        return f"an integer of {value.bit_length()} bits"


class SsgiError(Exception):
    """Base of every error of this library that is not a plain ValueError or TypeError."""


class DeviceError(SsgiError):
    """No OpenCL device fits what was asked for; the message lists those that exist."""


class DeviceMemoryError(DeviceError):
    """The device has too little memory; the message says how much is needed."""


class KernelBuildError(SsgiError):
    """A kernel did not compile; the message names entry, device, options and file:line."""


class KernelSourceError(SsgiError):
    """A kernel file or include does not exist, or includes itself."""


class SceneError(SsgiError, ValueError):
    """A scene file is missing, damaged, empty or of an unknown kind."""


class MissingExtraError(SsgiError, ImportError):
    """An optional package is not installed; the message names the extra that brings it."""


class SequenceError(SsgiError):
    """Frames of a sequence failed, or the cluster that computed them; the message says which and why."""


class TruthError(SsgiError):
    """A kept truth is damaged or is not the one asked for; the message names the file."""


class AssumedWarning(UserWarning):
    """Something that the caller did not say was assumed; the message says what, and how to say it."""


class RadiusWarning(UserWarning):
    """A radius reaches less than a pixel or over the whole image; the message names a sensible one."""
