"""Units in which a flow has a size near 1, made of its coefficients alone, so that nothing depends on other units."""

from __future__ import annotations

import math
from typing import Final

from finback.dynamics.flow import Flow, Scale, derivative, horner
from finback.dynamics.orbit.annulus import reach
from finback.dynamics.roots import real_roots
from finback.errors import InputError

_LARGEST: Final = 1e60  # a coefficient beyond it, in such units, has high powers that overflow


def natural_unit(flow: Flow) -> tuple[Flow, Scale]:
    """Return a flow in units of its own size, powers of two, and these units.

    The unit of length is how far the zeros of f and g, complex ones too, lie from the middle of the equilibria; the
    unit of time belongs to the fastest of these.

    Raises:
        InputError: the coefficients span too many orders of magnitude for double precision.
        RefusedError: the force is zero everywhere.
    """
    first = _in_units(flow, *_by_coefficients(flow))
    scaled, scale = first
    roots = [root.value for root in real_roots(scaled.force, magnitudes=scaled.force_sizes)]
    if not roots:
        return first
    slope = derivative(scaled.force)
    length = reach(scaled, roots[0], roots[-1])
    fastest = max(abs(horner(slope, x)) for x in roots)
    exponents = _exponent(length * scale.length_rad), _exponent(scale.time_s / math.sqrt(fastest or 1.0))
    return _in_units(flow, *exponents)


def _by_coefficients(flow: Flow) -> tuple[int, int]:
    """Return the logarithms to base 2 of a bound on the zeros of f and g, and of a time of g at that length."""
    logs = [[math.log2(abs(c)) if c else -math.inf for c in row] for row in (flow.damping, flow.force)]
    bounds = []
    for row in logs:
        last = max((k for k, value in enumerate(row) if math.isfinite(value)), default=0)
        bounds += [(row[k] - row[last]) / (last - k) for k in range(last) if math.isfinite(row[k])]
    length = max(bounds, default=0.0)
    fastest = max((value + (k - 1) * length for k, value in enumerate(logs[1])), default=-math.inf)
    return round(length), round(-0.5 * fastest) if math.isfinite(fastest) else 0


def _exponent(value: float) -> int:
    return round(math.log2(value)) if 0.0 < value < math.inf else 0


def _in_units(flow: Flow, length: int, time: int) -> tuple[Flow, Scale]:
    """Return a flow in units that are these powers of two; exact."""
    try:
        damping = tuple(math.ldexp(c, time + k * length) for k, c in enumerate(flow.damping))
        rows = [
            tuple(math.ldexp(c, 2 * time + (k - 1) * length) for k, c in enumerate(row))
            for row in (flow.force, flow.force_sizes)
        ]
        scale = Scale(length_rad=math.ldexp(1.0, length), time_s=math.ldexp(1.0, time))
    except OverflowError:
        damping, rows = (math.inf,), [(), ()]
    if max(map(abs, (*damping, *rows[0]))) > _LARGEST:
        raise InputError(
            "the coefficients of the flow are too large, or too unlike each other, for double precision",
            hint=f"in units of the flow's own size each must stay below {_LARGEST:.0e}",
        )
    return Flow(damping=damping, force=rows[0], force_sizes=rows[1]), scale
