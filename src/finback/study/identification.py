"""The table ``[identification]`` as options."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from finback.errors import InputError
from finback.identification.method import Method
from finback.identification.model_form import ModelForm
from finback.identification.nuisance import Nuisances
from finback.identification.options import IdentificationOptions


def identification_options(values: Mapping[str, Any]) -> IdentificationOptions:
    """Make options of the table's values in SI.

    ``alpha_dot_terms`` and ``q_dot_terms``, if given, stand instead of the orders; each is a list of terms such as
    ``"1"``, ``"alpha^2"``, ``"alpha*q"``, ``"q+alpha_dot"``.

    Raises:
        InputError: a value, or the combination, has no meaning.
    """
    rest = dict(values)
    orders = (rest.pop("alpha_dot_order"), rest.pop("q_dot_order"))
    terms = (rest.pop("alpha_dot_terms"), rest.pop("q_dot_terms"))
    if bool(terms[0]) != bool(terms[1]):
        raise InputError("alpha_dot_terms and q_dot_terms are given both or not at all")
    nuisances = Nuisances(**{name: rest.pop(name) for name in Nuisances.__slots__})
    return IdentificationOptions(
        alpha_order=orders,
        form=(ModelForm.parse(*terms),) if terms[0] else (),
        method=Method(rest.pop("method")),
        nuisances=nuisances,
        **rest,
    )
