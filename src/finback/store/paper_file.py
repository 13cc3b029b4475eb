"""A model in the form of Eq. (4) and (5) of Shi & Fan (2013), in degrees, as the paper prints it: TOML."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, Final

from finback.dynamics.reduction import PaperForm
from finback.store.model_table import Table
from finback.study.faults import nearest

SCHEMA: Final = "finback/paper-form/1"
RATE: Final = "alpha_dot_deg_s"
MOMENT: Final = "q_dot_deg_s2"
TURNING: Final = "f_q"
VARIABLES: Final = ("alpha_deg", "q_deg_s", "elevator_deg")
INPUTS: Final = ("canard_deg", "beta_deg", "p_deg_s", "r_deg_s")
KEYS: Final = ("schema", "source", RATE, MOMENT, TURNING, "held", "domain", "range")

_POWER: Final = re.compile(r"alpha([1-9]\d?)?")
_RATE_KEYS: Final = ("q", "constant", "alpha", "alpha2", "elevator", "canard", "alpha_beta")
_MOMENT_KEYS: Final = ("q_plus_alpha_dot", "q", "alpha_dot", "constant", "alpha", "alpha2", "elevator", "canard")
_TURNING_KEYS: Final = ("p_r", "r2_minus_p2")


def read_paper_form(table: Table) -> PaperForm | None:
    """Return the coefficients of a parsed file, or add its faults."""
    before = len(table.faults)
    table.keys("", table.root, list(KEYS))
    for name in (RATE, MOMENT):
        if name not in table.root:
            table.fault(name, f"missing; add a table [{name}]")
    rate = _coefficients(table, RATE, _RATE_KEYS, required=("q",))
    moment = _coefficients(table, MOMENT, _MOMENT_KEYS, required=())
    turning = table.numbers(TURNING, _TURNING_KEYS)
    both = moment.pop("q_plus_alpha_dot", None)
    if both is not None and {"q", "alpha_dot"} & set(moment):
        table.fault(f"{MOMENT}.q_plus_alpha_dot", "stands for q and alpha_dot together: give either it or those")
    if MOMENT in table.root and both is None and not {"q", "alpha_dot"} & set(moment):
        table.fault(f"{MOMENT}.q_plus_alpha_dot", "missing (or give q and alpha_dot)")
    if len(table.faults) > before:
        return None
    return PaperForm(
        C_zq=rate["q"] - 1.0,
        C_z=_in_alpha(rate),
        C_zde=rate.get("elevator", 0.0),
        M_zq=moment.get("q", both or 0.0),
        M_zad=moment.get("alpha_dot", both or 0.0),
        M_z=_in_alpha(moment),
        M_zde=moment.get("elevator", 0.0),
        C_zdc=rate.get("canard", 0.0),
        M_zdc=moment.get("canard", 0.0),
        C_zab=rate.get("alpha_beta", 0.0),
        f_pr=turning.get("p_r", 0.0),
        f_rr=turning.get("r2_minus_p2", 0.0),
    )


def _coefficients(table: Table, name: str, known: tuple[str, ...], required: tuple[str, ...]) -> dict[str, float]:
    """Return the numbers of one equation; powers of alpha are ``alpha``, ``alpha2``, and so on."""
    given: Mapping[str, Any] = table.table(name)
    found = {}
    for key, value in given.items():
        if key in known or _POWER.fullmatch(key):
            found[key] = table.number(f"{name}.{key}", value)
        else:
            table.fault(f"{name}.{key}", f"unknown term{nearest(key, list(known))}")
    for key in required:
        if name in table.root and key not in given:
            table.fault(f"{name}.{key}", "missing")
    return found


def _in_alpha(terms: Mapping[str, float]) -> tuple[float, ...]:
    """Return the constant and the coefficients of the powers of alpha, rising, gaps filled with 0."""
    row = {0: terms.get("constant", 0.0)}
    for key, value in terms.items():
        if match := _POWER.fullmatch(key):
            row[int(match[1] or 1)] = value
    return tuple(row.get(power, 0.0) for power in range(max(row) + 1))
