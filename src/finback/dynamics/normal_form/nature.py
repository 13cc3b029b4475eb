"""What an equilibrium of x' = y, y' = f(x) y + g(x) is, where its linearization does not tell, too."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from fractions import Fraction

from finback.errors import RefusedError


class Nature(StrEnum):
    """The local phase portrait."""

    SADDLE = "saddle"
    SINK = "sink"
    SOURCE = "source"
    WEAK_FOCUS = "weak-focus"
    """a pair of imaginary eigenvalues: a focus or a center, as the Lyapunov coefficients say"""
    SADDLE_NODE = "saddle-node"
    """nodal on one side, a saddle on the other"""
    CUSP = "cusp"
    """two zero eigenvalues, one curve through it that has a cusp: a Bogdanov-Takens point"""
    TOPOLOGICAL_SADDLE = "topological-saddle"
    TOPOLOGICAL_SINK = "topological-sink"
    TOPOLOGICAL_SOURCE = "topological-source"
    NILPOTENT_FOCUS = "nilpotent-focus"
    """two zero eigenvalues, orbits turn around it"""
    ELLIPTIC = "elliptic"
    """two zero eigenvalues, a sector of loops and a hyperbolic one"""


def nature(damping: Sequence[Fraction | float], force: Sequence[Fraction | float]) -> Nature:
    """Classify the equilibrium at the origin, by the first coefficients that are not exactly zero.

    The center manifold of a single zero eigenvalue is x' = −g_m x^m / f_0 + …; for two zero eigenvalues the theorem of
    Andreev (1958; Dumortier, Llibre & Artés 2006, theorem 3.5) is applied.

    Args:
        damping: coefficients of f by rising power.
        force: coefficients of g by rising power; the constant is 0.

    Raises:
        RefusedError: the force vanishes everywhere: every x is an equilibrium.
    """
    m = next((k for k, c in enumerate(force) if k > 0 and c != 0), 0)
    if m == 0:
        raise RefusedError("the force is zero everywhere: every x is an equilibrium")
    trace = damping[0] if damping else 0
    if m == 1:
        return _simple(trace, force[1])
    if trace != 0:
        if m % 2 == 0:
            return Nature.SADDLE_NODE
        if force[m] > 0:
            return Nature.TOPOLOGICAL_SADDLE
        return Nature.TOPOLOGICAL_SINK if trace < 0 else Nature.TOPOLOGICAL_SOURCE
    return _nilpotent(damping, m, force[m])


def _simple(trace: Fraction | float, slope: Fraction | float) -> Nature:
    if slope > 0:
        return Nature.SADDLE
    if trace == 0:
        return Nature.WEAK_FOCUS
    return Nature.SINK if trace < 0 else Nature.SOURCE


def _nilpotent(damping: Sequence[Fraction | float], m: int, leading: Fraction | float) -> Nature:
    """Apply Andreev's theorem to g = leading x^m + …, f = b x^n + …."""
    n = next((k for k, c in enumerate(damping) if c != 0), m)  # m stands for any power too high to matter
    b = damping[n] if n < len(damping) else 0
    if m % 2 == 0:
        return Nature.CUSP if 2 * n >= m else Nature.SADDLE_NODE
    if leading > 0:
        return Nature.TOPOLOGICAL_SADDLE
    turns = 2 * n > m - 1 or (2 * n == m - 1 and b * b + 4 * leading * (n + 1) < 0)
    if turns:
        return Nature.NILPOTENT_FOCUS
    if n % 2:
        return Nature.ELLIPTIC
    return Nature.TOPOLOGICAL_SINK if b < 0 else Nature.TOPOLOGICAL_SOURCE
