"""Docstrings of techniques name the paper that they implement, and where they depart from it."""

from __future__ import annotations

import inspect
import re
from typing import Any

import pytest

import ssgi_cl as gi
from ssgi_cl.techniques.catalogue import CATALOGUE

BESIDE = {"Choice", "auxiliary_cameras", "choose_vpls"}
"""What techniques use, of no paper of its own."""
TECHNIQUES = {
    name: value
    for name in gi.__all__
    if callable(value := getattr(gi, name))
    and value.__module__.startswith(("ssgi_cl.techniques.", "ssgi_cl.truth.ray_ao"))
    and not name.endswith("Params")
    and name not in BESIDE
}


def test_every_technique_is_looked_at() -> None:
    functions = {name for name, value in TECHNIQUES.items() if inspect.isfunction(value)}
    assert functions == {*CATALOGUE, "multi_bounce", "ray_ao"}


@pytest.mark.parametrize("name", sorted(TECHNIQUES))
def test_a_technique_names_its_paper_and_where_it_departs(name: str) -> None:
    value: Any = TECHNIQUES[name]
    text = " ".join((inspect.getdoc(value) or "").split())
    # An author and a year, such as "Kopf et al. 2007".
    assert re.search(r"\b[A-Z][a-z]+\b[\w ,.]* (19|20)\d\d\b", text), text
    assert re.search(r"\bDeparts\b|[Aa]s published", text), text
