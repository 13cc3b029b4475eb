"""What a maneuver will tell: Fisher's information about the coefficients of a model, before anything is flown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import PolynomialModel
from finback.dynamics.trajectory import HOLDS
from finback.errors import InputError, RefusedError
from finback.identification.field import layout
from finback.identification.model_form import ModelForm
from finback.identification.shooting import OWN, shoot
from finback.identification.term import Monomial, Term

_SUBSTEPS: Final = 4


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedFlight:
    """A flight that could be flown.

    Attributes:
        name: unique among candidates.
        elevator_rad: the elevator at the samples, shape (n,).
        hold: ``foh`` or ``zoh``.
        interval_s: time between samples, in s.
        alpha_rad: angle of attack at the start.
        q_rad_s: pitch rate at the start.
    """

    name: str
    elevator_rad: FloatArray
    hold: str
    interval_s: float
    alpha_rad: float
    q_rad_s: float

    def __post_init__(self) -> None:
        """Freeze and check."""
        object.__setattr__(self, "elevator_rad", frozen_array(self.elevator_rad))
        if self.elevator_rad.ndim != 1 or self.elevator_rad.size < 2 or not self.interval_s > 0:
            raise InputError(f"flight '{self.name}' needs two samples or more, a positive time apart")
        if self.hold not in HOLDS:
            raise InputError(f"flight '{self.name}': hold '{self.hold}' is unknown", hint=f"use {' or '.join(HOLDS)}")


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Information:
    """What one flight tells of a model.

    Attributes:
        flight: the flight.
        states: alpha in rad and q in rad/s that the model predicts, shape (n, 2).
        matrix: Fisher's information about the coefficients, those of dα/dt first, shape (p, p) in SI; the start of
            the flight is unknown and estimated with them.
    """

    flight: PlannedFlight
    states: FloatArray
    matrix: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        object.__setattr__(self, "states", frozen_array(self.states))
        object.__setattr__(self, "matrix", frozen_array(self.matrix))


def form_of(model: PolynomialModel) -> ModelForm:
    """Return the terms of a model as a form, in the order of its coefficients."""
    one, two = (
        tuple(
            Term(
                monomials=(
                    Monomial(
                        factors=tuple(
                            (name, int(power)) for name, power in zip(polynomial.variables, row, strict=True) if power
                        )
                    ),
                )
            )
            for row in polynomial.powers.tolist()
        )
        for polynomial in (model.alpha_dot, model.q_dot)
    )
    return ModelForm(alpha_dot=one, q_dot=two)


def information(model: PolynomialModel, flight: PlannedFlight, *, noise: tuple[float, float]) -> Information:
    """Predict a flight and what it will tell of the coefficients.

    White noise of known size on alpha and q at every sample; the elevator is known. The bound is that of output error
    (maximum likelihood) with an unknown start: no unbiased estimator has smaller variances (Cramér and Rao).

    Args:
        model: as good as it is known before the flight; it has no further inputs.
        flight: what would be flown.
        noise: standard deviations of alpha in rad and q in rad/s, both > 0.

    Raises:
        InputError: the noise is not positive, or the model has further inputs.
        RefusedError: the model leaves every bound in this flight.
    """
    model.refuse_inputs("input design")
    if not all(deviation > 0 for deviation in noise):
        raise InputError(f"the noise of alpha and q must be positive, got {noise}", hint="state what the sensors have")
    inputs = flight.elevator_rad[:, np.newaxis]
    with np.errstate(all="ignore"):  # a flight that blows up is refused below
        solution = shoot(
            layout(form_of(model)),
            model.coefficients,
            np.array([flight.alpha_rad, flight.q_rad_s]),
            inputs,
            held=np.array([float(flight.hold == "zoh")]),
            samples=(0, len(inputs) - 1),
            interval_s=flight.interval_s,
            delay_s=0.0,
            substeps=_SUBSTEPS,
        )
    size = model.coefficients.size
    rows = solution.sensitivity[:, :, : OWN + size] / np.array(noise)[:, np.newaxis]
    if not np.isfinite(rows).all():
        raise RefusedError(f"flight '{flight.name}': the model leaves every bound", hint="choose a smaller amplitude")
    whole = np.einsum("nij,nik->jk", rows, rows)
    start, mixed = whole[:OWN, :OWN], whole[:OWN, OWN:]
    return Information(
        flight=flight, states=solution.states, matrix=whole[OWN:, OWN:] - mixed.T @ np.linalg.solve(start, mixed)
    )
