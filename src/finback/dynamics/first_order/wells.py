"""Loops and folds of cycles of the wells, to first order: a2 = −1, b2 = −1, which Shi & Fan 2013 leave open.

x = ε z, |b0| = ε². For b0 > 0 two wells stand beside a saddle at the origin, whose level curve is a figure-eight; see
Guckenheimer & Holmes 1983, section 7.3, for a1 = b1 = 0 and Dumortier & Li 2001-2003 for the rest. Every a0 here is
an estimate of what the loops of ``Cubic.family()`` are exactly; for folds of cycles see ``first_order_folds``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, final

from finback.dynamics.first_order.abelian import RingKind, first_order, level_integrals, rings
from finback.dynamics.first_order.estimate import FIRST_ORDER, Estimate, estimate_in_eps
from finback.dynamics.normal_form.cubic import Cubic
from finback.errors import RefusedError

_LARGE_ORDER: Final = "O(eps^3 ln eps) in a0, eps = sqrt(b0), at fixed a1/eps and b1/eps"


class LargeLoop(StrEnum):
    """Which way the loop around both wells runs."""

    LEAVES_RIGHT = "leaves-right"
    """from the saddle to the right around the right well, over the left well and back from the left"""
    LEAVES_LEFT = "leaves-left"
    BOTH = "both"
    """both small loops exist at once, and the large loop is the two of them"""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class WellLoops:
    """The three homoclinic loops of the saddle between two wells, as values of a0.

    Attributes:
        left: the small loop around the left well.
        right: the small loop around the right well.
        large: the loop around both.
        direction: how the large loop runs.
    """

    left: Estimate
    right: Estimate
    large: Estimate
    direction: LargeLoop


def closed_well_moments(b1: float) -> tuple[float, float]:
    """Return I1/I0 and I2/I0 on the small right loop for b0 = 1, about the saddle, in closed form.

    For the left loop take b1 with the other sign, and the first value with the other sign. The integrals cancel where
    the loop is small (b1 below 0): 1e-10 is left at b1 = −10.
    """
    m = 2.0 * b1 / 3.0
    rho = math.hypot(m, math.sqrt(2.0))
    sine, cosine = -m / rho, math.sqrt(2.0) / rho
    turn = math.atan2(math.sqrt(2.0), -m)  # from the turning point to the saddle
    c_0 = 0.5 * (turn - sine * cosine)
    c_1 = cosine**3 / 3.0
    c_2 = 0.125 * (turn + sine * cosine * (1.0 - 2.0 * sine * sine))
    c_3 = cosine**3 / 3.0 - cosine**5 / 5.0
    i_0 = m * c_0 + rho * c_1
    i_1 = m * m * c_0 + 2.0 * m * rho * c_1 + rho * rho * c_2
    i_2 = m**3 * c_0 + 3.0 * m * m * rho * c_1 + 3.0 * m * rho * rho * c_2 + rho**3 * c_3
    return i_1 / i_0, i_2 / i_0


def well_loops_estimate(cubic: Cubic) -> WellLoops:
    """Return the a0 of the small loops (k_L b0, k_R b0) and of the large one (k_8 b0).

    k_8 = (k_L I0L + k_R I0R)/(I0L + I0R): the large loop passes the saddle at a finite distance in energy, so that its
    error is of lower order than that of the others.

    Raises:
        RefusedError: the system is not in normal form with b2 = −1 and b0 > 0.
    """
    if not cubic.is_normal or cubic.b2 > 0.0 or cubic.b0 <= 0.0:
        raise RefusedError(
            f"no saddle between two wells in {cubic}",
            hint="bring it to normal form around the middle equilibrium: centered()",
        )
    a0 = {}
    for ring in rings(cubic):
        on = level_integrals(ring, 0.0 if ring.kind is RingKind.OUTER else ring.top)
        a0[ring.kind] = first_order(ring, on, a2=cubic.a2, a1=cubic.a1)
    left, right = a0[RingKind.LEFT_WELL], a0[RingKind.RIGHT_WELL]
    symmetric = cubic.a1 == 0.0 and cubic.b1 == 0.0
    order = FIRST_ORDER if symmetric else _LARGE_ORDER
    cautions = () if symmetric else ("off by eps ln eps relative, more than the small loops",)
    direction = LargeLoop.LEAVES_RIGHT if right < left else LargeLoop.LEAVES_LEFT
    eps = math.sqrt(cubic.b0)
    return WellLoops(
        left=estimate_in_eps(left, eps=eps, order=FIRST_ORDER),
        right=estimate_in_eps(right, eps=eps, order=FIRST_ORDER),
        large=estimate_in_eps(a0[RingKind.OUTER], eps=eps, order=order, cautions=cautions),
        direction=LargeLoop.BOTH if symmetric else direction,
    )
