"""The loop between two saddles, to first order (Shi & Fan 2013, section 3.2-3.3: a2 = −1, b2 = 1).

x = ε z, b0 = −ε²: to first order in ε the loop lies at a0 = −k_sc b0, the fold of cycles at a0 = −k_d b0 (for that see
``first_order_folds``). The exact curves are the loops and the folds of cycles of ``Cubic.family()``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from scipy.optimize import brentq

from finback.dynamics.first_order.abelian import first_order, level_integrals, rings
from finback.dynamics.first_order.estimate import FIRST_ORDER, Estimate, estimate_in_eps
from finback.dynamics.normal_form.cubic import Cubic
from finback.errors import InputError, RefusedError

_CANCELED: Final = 0.1
"""Below this share of its two parts k_sc is a difference with few digits left at eps of order 1."""
_SPLIT: Final = 0.25
"""Below this b1/(a1 b0) the loop is as near to the two-saddle cycle as the second order can move it (measured: the
cycle closes at b1/(a1 b0) = 0.076 for a1 = 0.3, b0 = -0.49)."""
_SMALLEST_BETA: Final = 1e-8
_LARGEST_BETA: Final = 1e6


def closed_loop_moments(b1: float) -> tuple[float, float]:
    """Return P* = I1/I0 and Q* = I2/I0 on the loop for b0 = −1, in closed form.

    The loop's speed is (z* − z) √((z + h)² − D) / √2: elementary integrals, which cancel as b1 grows (1e-14 relative
    up to |b1| = 1, 1e-12 at 2, 1e-8 at 10, nothing left at 100); ``loop_moments`` does not.
    """
    if b1 < 0.0:
        p, q = closed_loop_moments(-b1)
        return -p, q
    z = 2.0 / (b1 + math.hypot(b1, 2.0))
    h = z + 2.0 * b1 / 3.0
    d = 2.0 / 3.0 * b1 * h  # p²/4 − q of the remaining quadratic, without its cancellation
    v, r = z + h, math.sqrt(2.0 * (1.0 + z * z))
    logarithm = math.asinh(r / math.sqrt(d)) if d else 0.0  # times d it vanishes with d
    a_0 = 0.5 * (v * r - d * logarithm)
    a_1 = r**3 / 3.0
    a_2 = 0.25 * (v * r**3 + d * a_0)
    a_3 = r**5 / 5.0 + d * r**3 / 3.0
    b_0, b_1, b_2 = v * a_0 - a_1, v * a_1 - a_2, v * a_2 - a_3
    return b_1 / b_0 - h, b_2 / b_0 - 2.0 * h * b_1 / b_0 + h * h


def loop_moments(b1: float) -> tuple[float, float]:
    """Return P* and Q* on the loop for b0 = −1 by quadrature, to 1e-14 of the loop's width for any b1."""
    (ring,) = rings(Cubic(a1=0.0, a0=0.0, b1=b1, b0=-1.0))
    on = level_integrals(ring, ring.top)
    return on.P, on.Q


def k_sc(a1: float, b1: float) -> float:
    """Return k_sc = Q* − a1 P*, the a0 of the loop for b0 = −1 to first order (Eq. 26); 1/5 for b1 = 0."""
    p, q = loop_moments(b1)
    return q - a1 * p


def loop_estimate(cubic: Cubic) -> Estimate:
    """Return a0 ≈ −k_sc b0 of the loop at the lower saddle (of the two-saddle cycle for b1 = 0).

    Near b1 = 0, with a1 ≠ 0, the two halves of the two-saddle cycle exist at different a0, and cycles that no Abelian
    integral sees lie next to it (Caubergh, Dumortier & Roussarie 2005); the estimate says so there.

    Raises:
        RefusedError: the system is not in normal form with b2 = 1 and b0 < 0.
    """
    _check(cubic)
    (ring,) = rings(cubic)
    on = level_integrals(ring, ring.top)
    value = first_order(ring, on, a2=cubic.a2, a1=cubic.a1)
    cautions = []
    if abs(value) < _CANCELED * (on.Q + abs(cubic.a1 * on.P)):
        cautions.append("k_sc nearly vanishes here: the estimate has no relative accuracy")
    if cubic.a1 != 0.0 and abs(cubic.b1) <= _SPLIT * abs(cubic.a1 * cubic.b0):
        cautions.append(
            "near b1 = 0 with a1 ≠ 0 the two-saddle cycle splits at the next order: the loop is homoclinic, and the "
            "two-saddle cycle lies at another b1"
        )
    return estimate_in_eps(value, eps=math.sqrt(-cubic.b0), order=FIRST_ORDER, cautions=tuple(cautions))


def slope_at_loop(b1: float) -> float:
    """Return dQ/dP of the curve R at the loop for b0 = −1: (Q* − z*²)/(P* − z*); at the other end it is 1/b1."""
    p, q = loop_moments(b1)
    z = math.copysign(2.0 / (abs(b1) + math.hypot(b1, 2.0)), b1)
    return (q - z * z) / (p - z)


def neutral_loop_b0(a1: float, b1: float) -> Estimate:
    """Return b_d, the b0 at which the fold of cycles meets the loop (Eq. 34): the loop of a neutral saddle.

    b_d = −(b1/β)² with β the root of slope_at_loop(β) = (a1/b1) β, which is unique.

    Raises:
        InputError: a1 b1 is not positive; there is no fold then, to first order.
    """
    ratio = _ratio(a1, b1)
    return _b0_estimate(b1, _beta(lambda beta: slope_at_loop(beta) - ratio * beta))


def vanishing_loop_b0(a1: float, b1: float) -> Estimate:
    """Return b_x, the b0 at which the loop and the Hopf bifurcation have the same a0 (k_sc = 0): b_d < b_x < −a1 b1.

    Raises:
        InputError: a1 b1 is not positive; k_sc is positive then.
    """
    ratio = _ratio(a1, b1)

    def excess(beta: float) -> float:
        p, q = loop_moments(beta)
        return q / p - ratio * beta

    return _b0_estimate(b1, _beta(excess))


def _check(cubic: Cubic) -> None:
    if not cubic.is_normal or cubic.b2 < 0.0 or cubic.b0 >= 0.0:
        raise RefusedError(
            f"no loop between two saddles is known to first order for {cubic}",
            hint="bring it to normal form around the middle equilibrium: centered()",
        )


def _ratio(a1: float, b1: float) -> float:
    if not (a1 * b1 > 0.0 and math.isfinite(a1) and math.isfinite(b1)):
        raise InputError(
            f"a1 = {a1} and b1 = {b1} have no positive product: to first order no cycles fold and k_sc is positive"
        )
    return a1 / b1


def _beta(excess: Callable[[float], float]) -> float:
    """Return the root of a function that falls from plus to minus."""
    low, high = _SMALLEST_BETA, _LARGEST_BETA
    if not (excess(low) > 0.0 > excess(high)):
        raise RefusedError("a1/b1 is so large or so small that the loop cannot be computed in double precision")
    return float(brentq(excess, low, high, xtol=1e-300, rtol=1e-14))


def _b0_estimate(b1: float, beta: float) -> Estimate:
    value = -((b1 / beta) ** 2)
    return estimate_in_eps(value, eps=abs(b1 / beta), order="O(eps^2) relative, eps = sqrt(-b0), at fixed a1/b1")
