"""How a splitting moves with the parameters: the Melnikov integral along the exact connecting orbit.

With x' = y and y' = F, the wedge D = x' δy − y' δx of the orbit's speed and a displacement obeys
D' = f D + y δF (Melnikov 1963; Guckenheimer & Holmes 1983, section 4.5, there for f = 0). Along a connection of two
saddles this gives D on both manifolds at once, and their difference is ∫ exp(−∫f dt) y δF dt over all time.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from scipy.special import roots_jacobi, roots_laguerre, roots_legendre

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.flow import Flow, shifted
from finback.dynamics.orbit.manifold import Branch
from finback.dynamics.orbit.splitting import Splitting
from finback.dynamics.orbit.taylor import Piece

_PIECE_NODES: Final = 24
_TAIL_NODES: Final = 32
_HIGH_POWER: Final = 50.0


def moments(flow: Flow, joined: Splitting) -> tuple[FloatArray, FloatArray]:
    """Return ∫ E y² x^k dt and ∫ E y x^k dt, with E = exp(−∫f dt) from where the branches meet.

    They are what the coefficient of x^k in f, and that in g, does to the splitting.

    Returns:
        for k up to the degree of f, shape (n_f,); for k up to the degree of g, shape (n_g,). Not finite where E
        leaves the range of double precision.
    """
    total_f, total_g = np.zeros(len(flow.damping)), np.zeros(len(flow.force))
    with np.errstate(all="ignore"):  # an orbit too slow for double precision gives what is not finite, as documented
        for branch, sign in ((joined.outgoing, 1.0), (joined.incoming, -1.0)):
            for weight, x, y in _nodes(flow, branch):
                total_f += sign * ((weight * y) @ np.vander(x, len(total_f), increasing=True))
                total_g += sign * (weight @ np.vander(x, len(total_g), increasing=True))
    return total_f, total_g


def _nodes(flow: Flow, branch: Branch) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
    """Return weight (E y dt), x and y at the nodes of the path, then of the series, saddle to end."""
    found = []
    exponent = 0.0  # ∫f dt from the meeting point back to the end of the piece
    for piece in reversed(branch.path.pieces):
        exponent -= _damping_integral(piece, np.array(piece.span)).item()
        time, weight = _legendre(piece.span)
        x, y = np.polynomial.polynomial.polyval(time, np.array([piece.x, piece.y]).T)
        growth = np.exp(-(exponent + _damping_integral(piece, time)))
        found.append((weight * growth * y, x, y))
    found.append(_tail(flow, branch, np.exp(-exponent)))
    return found


def _damping_integral(piece: Piece, time: FloatArray) -> FloatArray:
    series = np.array([0.0, *(c / (k + 1) for k, c in enumerate(piece.f))])
    return np.asarray(np.polynomial.polynomial.polyval(time, series))


def _legendre(span: float) -> tuple[FloatArray, FloatArray]:
    nodes, weights = _gauss()
    return 0.5 * span * (nodes + 1.0), 0.5 * span * weights


@cache
def _gauss() -> tuple[FloatArray, FloatArray]:
    """Return the rule on (−1, 1); scipy computes it anew every time it is asked."""
    nodes, weights = roots_legendre(_PIECE_NODES)
    return frozen_array(nodes), frozen_array(weights)


def _tail(flow: Flow, branch: Branch, start: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the nodes on the series, where dt = du / h(u) and time is without end.

    With f/h = f0/(λ u) + ρ(u), E dx is (u/u1)^(−f0/λ) exp(∫ρ) du: a Gauss-Jacobi rule takes the power, which is
    more than −1 because f0 is the sum of both eigenvalues.
    """
    whole, reach = branch.manifold, branch.reach
    power = -1.0 - whole.other_eigenvalue / whole.eigenvalue
    share, weights = powered(power)
    u = reach * share
    series = np.array(whole.series)
    f = np.zeros(series.size - 1)
    local = shifted(flow.damping, whole.saddle)[: f.size]
    f[: len(local)] = local
    # f u / h as a series, by division; its constant is f0/λ, the rest, divided by u, is ρ.
    quotient = np.zeros(f.size)
    for k in range(f.size):
        quotient[k] = (f[k] - quotient[:k] @ series[k + 1 : 1 : -1][:k]) / series[1]
    primitive = np.array([0.0, *(quotient[1:] / np.arange(1, f.size))])
    ends = np.polynomial.polynomial.polyval(np.array([reach, *u]), primitive)
    regular = np.exp(ends[0] - ends[1:])
    weight = start * reach * weights * regular
    return weight, whole.saddle + u, np.polynomial.polynomial.polyval(u, series)


def powered(power: float) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights for ∫ s^power G(s) ds from 0 to 1, power > −1.

    For a high power, where Jacobi weights overflow, s = exp(−t/(power + 1)) makes it a Gauss-Laguerre rule.
    """
    if power > _HIGH_POWER:
        times, weights = roots_laguerre(_TAIL_NODES)
        return np.exp(-times / (power + 1.0)), weights / (power + 1.0)
    nodes, weights = roots_jacobi(_TAIL_NODES, 0.0, power)
    return 0.5 * (nodes + 1.0), weights * 0.5 ** (power + 1.0)
