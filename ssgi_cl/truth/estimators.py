"""Versions of the estimators: with the settings, what a stored truth is found by."""

from __future__ import annotations

from typing import Any

VERSIONS = {
    "occlusion": 1,
    "bent normals": 1,
    "layered occlusion": 1,
    "ssao": 2,
    "slices": 2,
    "light": 1,
    "radiance": 1,
    "glossy radiance": 1,
    "blended radiance": 1,
}
"""Name of an estimator -> version. Raise it with every change that alters a result: truths that
were stored before are then computed anew. `tests/truth/test_estimators.py` holds the result of each
to the value that is recorded for its version; names and comments may change freely."""


def versioned(name: str) -> dict[str, Any]:
    """Return name and version of an estimator, for the description of a truth."""
    return {"name": name, "version": VERSIONS[name]}
