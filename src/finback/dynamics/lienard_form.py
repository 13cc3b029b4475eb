"""The general reduction to one equation of second order, with every input free to move (Eq. 4-11)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.dual import Dual
from finback.dynamics.lienard import Curve
from finback.dynamics.model import INPUT, STATE, PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.errors import InputError, RefusedError

Exponents = tuple[int, ...]
Terms = dict[Exponents, Dual]
"""Exponents -> coefficient with its derivative by θ."""

_ROUNDINGS: Final = 8  # conversion to SI, substitution of dα/dt, products and difference


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class LienardForm:
    """x'' = f(x, u) x' + g(x, u) + Σ hᵢ(x, u) uᵢ', where x is alpha and u are the inputs, elevator first. Exact.

    This is Eq. (10) and (11) of Shi & Fan (2013) for inputs that move. Two places of the paper are mended: g holds
    f_q(p, r) itself, not its derivative by time, because only dq/dt enters x''; and the rate of the sideslip has the
    gain C_zab·alpha, which the paper drops. With all inputs but the elevator held, ``reduction.reduce`` gives the
    system that can be analyzed.

    Attributes:
        damping: f in 1/s, a curve in ``alpha_rad`` and the inputs.
        force: g in rad/s², the paper's b without rates included, a curve in the same variables.
        rate_gains: hᵢ, one curve for each input: what multiplies its rate. Where hᵢ does not vanish, a step of the
            input makes x' jump while q is continuous.
        pitch_rate: q where dα/dt = 0, rad/s, a curve in the same variables.
        pitch_rate_gain: derivative of q by dα/dt, a pure number near 1.
        covariance: of θ, the coefficients of the model, shape (p, p).
    """

    damping: Curve
    force: Curve
    rate_gains: tuple[Curve, ...]
    pitch_rate: Curve
    pitch_rate_gain: float
    covariance: FloatArray

    def __post_init__(self) -> None:
        """Freeze the covariance."""
        object.__setattr__(self, "covariance", frozen_array(self.covariance))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs with unit, the elevator first."""
        return self.force.polynomial.variables[1:]

    def gain(self, name: str) -> Curve:
        """Return ∂g/∂u of an input: the constant (1 + C_zq) M_zdc − M_zq C_zdc for the canard of Eq. (11)."""
        return self.force.derivative(self.inputs[self._index(name)])

    def rate_gain(self, name: str) -> Curve:
        """Return what multiplies the rate of an input: C_zde (c₂) for the elevator, C_zab·alpha for the sideslip."""
        return self.rate_gains[self._index(name)]

    def acceleration(
        self, alpha_rad: float, alpha_dot_rad_s: float, inputs: Mapping[str, float], rates: Mapping[str, float]
    ) -> float:
        """Return d²α/dt² in rad/s².

        Args:
            alpha_rad: the angle.
            alpha_dot_rad_s: its rate.
            inputs: value of every input by its name, in SI.
            rates: rate of those inputs that move, by the name of the input, per second; 0 for those not named.
        """
        if set(inputs) != set(self.inputs) or not set(rates) <= set(self.inputs):
            raise InputError(f"the inputs are {', '.join(self.inputs)}, got {sorted({*inputs, *rates})}")
        point = (alpha_rad, *(inputs[name] for name in self.inputs))
        moving = sum(float(self.rate_gain(name)(*point)) * rate for name, rate in rates.items())
        return float(self.damping(*point)) * alpha_dot_rad_s + float(self.force(*point)) + moving

    def _index(self, name: str) -> int:
        if name not in self.inputs:
            raise InputError(f"no input {name}", hint=f"there are {', '.join(self.inputs)}")
        return self.inputs.index(name)


def lienard_form(model: PolynomialModel) -> LienardForm:
    """Eliminate q from a model, for any orders in alpha and the inputs.

    With dα/dt = A(α, u) + a q and dq/dt = B(α, u) + b(α, u) q, differentiating the first and inserting the second
    gives f = ∂A/∂α + b, g = a B − b A, hᵢ = ∂A/∂uᵢ. This is exact.

    Raises:
        RefusedError: q enters in another way (such as alpha*q in alpha_dot, or q^2), or not at all in alpha_dot.
    """
    alpha_dot, q_dot = model_terms(model)
    alone = tuple(int(name == STATE[1]) for name in model.alpha_dot.variables)
    foreign = [
        *(f"{term_label(term, model)} in alpha_dot" for term in alpha_dot if term[1] > 0 and term != alone),
        *(f"{term_label(term, model)} in q_dot" for term in q_dot if term[1] > 1),
    ]
    if foreign:
        raise RefusedError(
            f"the Liénard form cannot hold {', '.join(foreign)}",
            hint="it holds q to the first power only, in alpha_dot without another factor",
        )
    size = model.coefficients.size
    a_q = alpha_dot.get(alone, Dual(0.0, np.zeros(size)))
    if a_q.value == 0.0:
        raise RefusedError(
            "alpha_dot does not depend on q: the two equations are not one equation of second order",
            hint="a Liénard form needs the term q in alpha_dot (about 1)",
        )
    a, b, b_q = _of_power(alpha_dot, 0), _of_power(q_dot, 0), _of_power(q_dot, 1)
    force = _sum(
        [
            *((key, a_q * c) for key, c in b.items()),
            *((_add(left, right), -(c * d)) for left, c in b_q.items() for right, d in a.items()),
        ]
    )
    damping = _sum([*_derivative(a, 0), *b_q.items()])
    variables = (STATE[0], INPUT, *model.inputs)
    box = common_domain(model)[[0, *range(2, 2 + len(variables) - 1)]]

    def curve(terms: Terms, unit: str) -> Curve:
        constant = (0,) * len(variables)
        return _curve({constant: Dual(0.0, np.zeros(size))} | terms, variables, unit, box)

    return LienardForm(
        damping=curve(damping, "1_s"),
        force=curve(force, "rad_s2"),
        rate_gains=tuple(curve(dict(_derivative(a, column)), "1_s") for column in range(1, len(variables))),
        pitch_rate=curve({key: -c / a_q for key, c in a.items()}, "rad_s"),
        pitch_rate_gain=1.0 / a_q.value,
        covariance=model.covariance,
    )


def model_terms(model: PolynomialModel) -> tuple[Terms, Terms]:
    """Return the terms of dα/dt and of dq/dt with their derivatives by the model's coefficients.

    Terms that are exactly zero (no value, no variance) are left out.
    """
    unit = np.eye(model.coefficients.size)
    powers = np.concatenate([model.alpha_dot.powers, model.q_dot.powers])
    split = model.alpha_dot.coefficients.size
    alpha_dot: Terms = {}
    q_dot: Terms = {}
    for i, (exponents, value) in enumerate(zip(powers.tolist(), model.coefficients.tolist(), strict=True)):
        if value != 0.0 or model.covariance[i, i] != 0.0:
            (alpha_dot if i < split else q_dot)[tuple(exponents)] = Dual(value, unit[i])
    return alpha_dot, q_dot


def term_label(exponents: Exponents, model: PolynomialModel) -> str:
    """Return how messages write a term: ``alpha^2*q``."""
    one = Polynomial.build({exponents: 1.0}, variables=model.alpha_dot.variables, value_unit="1")
    return one.labels()[0]


def common_domain(model: PolynomialModel) -> FloatArray:
    """Return low and high of each variable where data supported both equations, shape (v, 2)."""
    low = np.maximum(model.alpha_dot.domain[:, 0], model.q_dot.domain[:, 0])
    high = np.minimum(model.alpha_dot.domain[:, 1], model.q_dot.domain[:, 1])
    return np.stack([low, high], axis=1)


def _of_power(terms: Terms, q: int) -> Terms:
    """Return the terms with this power of q, as terms of alpha and the inputs."""
    return {(term[0], *term[2:]): c for term, c in terms.items() if term[1] == q}


def _add(left: Exponents, right: Exponents) -> Exponents:
    return tuple(i + j for i, j in zip(left, right, strict=True))


def _derivative(terms: Terms, column: int) -> Iterator[tuple[Exponents, Dual]]:
    for key, c in terms.items():
        if key[column]:
            yield (*key[:column], key[column] - 1, *key[column + 1 :]), c.times(key[column])


def _sum(parts: list[tuple[Exponents, Dual]]) -> Terms:
    """Add terms; exactly 0 where rounding alone may have left the sum.

    A remainder of 1e-17 in place of 0 as the highest coefficient would put roots at angles of 1e16.
    """
    total: Terms = {}
    size: dict[Exponents, float] = {}
    for key, c in parts:
        total[key] = total[key] + c if key in total else c
        size[key] = size.get(key, 0.0) + abs(c.value)
    least = _ROUNDINGS * np.finfo(np.float64).eps
    return {key: Dual(0.0, c.gradient) if abs(c.value) <= least * size[key] else c for key, c in total.items()}


def _curve(terms: Terms, variables: tuple[str, ...], unit: str, domain: FloatArray) -> Curve:
    ordered = sorted(terms)
    return Curve(
        polynomial=Polynomial.build(
            {key: terms[key].value for key in ordered}, variables=variables, value_unit=unit, domain=domain
        ),
        sensitivity=frozen_array([terms[key].gradient for key in ordered]),
    )
