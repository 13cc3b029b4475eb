"""Reference values of the benchmarks, by a road of their own: Taylor series in 34 decimal digits.

Run with the extra `bench` (mpmath comes with it) it computes them all again and compares, in some minutes. Orbits start
on the eigenvector, 1e-16 from a saddle, where the manifold is straight to 32 digits; at a fold of cycles the divergence
along the closed orbit vanishes. The Liénard form of the F-8 II is derived here again from the printed coefficients.
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parent.parent
DIGITS: Final = 34
ORDER: Final = 36

# x' = y, y' = (−x² + x/2 + a0) y + (x² + x/2 + b0) x: the a0 of the homoclinic loop at each b0.
CUBIC_B0: Final = tuple(-0.5 - 1.5 * k / 9.0 for k in range(10))
CUBIC_LOOP_A0: Final = (
    0.012338753739315162,
    0.026448598701613688,
    0.0423101697676324,
    0.05945582368723058,
    0.07760090682949,
    0.09655726877981069,
    0.11619305064701752,
    0.1364116971921256,
    0.15714004074153815,
    0.1783210866044266,
)
# The same system at b0 = −0.35: the a0 at which two cycles meet.
CYCLE_B0: Final = -0.35
CYCLE_FOLD_A0: Final = 0.0025196783561838823
# The same system: where its homoclinic saddle is neutral, b0 and a0.
NEUTRAL_LOOP: Final = (-0.5463008119454846, 0.01604392351354991)
# x' = y, y' = (−x² + a1 x + a0) y + (−x² + b1 x + b0) x at a1, b1, b0: the a0 of the loops, by the side to which they
# leave and how often they turn. Of the second system the others are too stiff for explicit steps of 34 digits.
WELLS: Final = ((0.3, 0.2, 1.0), (3.0, 0.1, 7.35))
WELLS_LOOP_A0: Final = (
    {(-1, 1): 0.9005265731693977, (1, 1): 0.7084974802475629, (1, 2): 0.7692406114445823},
    {(1, 1): -0.7980584264438852},
)
# The first of them: the a0 at which two large cycles meet.
WELLS_FOLD_A0: Final = 0.7614552824005479
# x' = y, y' = μ1 + μ2 y + x² + x y: the μ2 of the homoclinic loop at each μ1.
UNFOLDING_MU1: Final = tuple(-0.02 - 0.44 * k / 9.0 for k in range(10))
UNFOLDING_LOOP_MU2: Final = (
    0.10161304819961169,
    0.18952926181678026,
    0.24863643732529386,
    0.2965534519430542,
    0.33801720772666866,
    0.37514236476609203,
    0.4090917134504918,
    0.44058595389595673,
    0.47010839339605015,
    0.498001842147101,
)
# The F-8 II as published: elevators in deg of the folds and of the connections with α̇ > 0 and with α̇ < 0.
FOLD_DEG: Final = (-35.12932390820522, 14.725215380796866)
CONNECTION_DEG: Final = (-18.306819824839042, -2.1186343839456256)

Row = Sequence[Any]


def value(row: Row, x: Any) -> Any:
    """Evaluate a polynomial by rising power."""
    total = 0 * x
    for c in reversed(row):
        total = total * x + c
    return total


def slope(row: Row) -> Row:
    """Return the derivative of a polynomial."""
    return [k * c for k, c in enumerate(row)][1:]


def series(f: Row, g: Row, x: Any, y: Any) -> tuple[Row, Row, Row]:
    """Return the Taylor coefficients of x, y and f(x) along the orbit through a state."""
    xs, ys, fs = [x], [y], []
    powers: list[list[Any]] = [[], xs, *([] for _ in range(len(g)))]
    for k in range(ORDER):
        for power in range(2, max(len(f), len(g))):
            powers[power].append(sum(powers[power - 1][m] * xs[k - m] for m in range(k + 1)))
        one = 1 if k == 0 else 0
        fs.append(f[0] * one + sum(c * powers[p][k] for p, c in enumerate(f) if p))
        push = g[0] * one + sum(c * powers[p][k] for p, c in enumerate(g) if p)
        push += sum(fs[m] * ys[k - m] for m in range(k + 1))
        xs.append(ys[k] / (k + 1))
        ys.append(push / (k + 1))
    return xs, ys, fs


def follow(f: Row, g: Row, state: tuple[Any, Any], way: int, section: Any) -> tuple[Any, Any, Any]:
    """Follow an orbit to x = ``section``, or without one to y = 0; return x, y and the integral of f."""
    from mpmath import mp, mpf  # noqa: PLC0415 - only this road needs it

    x, y = state
    damped = mpf(0)
    for _ in range(2000):
        xs, ys, fs = series(f, g, x, y)
        size = max(abs(x), abs(y))
        span = min((mp.eps * size / abs(row[k])) ** (mpf(1) / k) for row in (xs, ys) for k in (ORDER - 1, ORDER))
        span = way * min(span, mpf(1) / 2)
        primitive = [mpf(0), *(c / (k + 1) for k, c in enumerate(fs))]
        row = ys if section is None else [xs[0] - section, *xs[1:]]
        # From y = 0 itself the first zero is the start.
        sign = row[0] or way * row[1]
        if value(row, span) * sign <= 0:
            time = mp.findroot(lambda t, row=row: value(row, t), (span / 2, span), tol=mp.eps**2 * 1000, verify=False)
            return value(xs, time), value(ys, time), damped + value(primitive, time)
        x, y, damped = value(xs, span), value(ys, span), damped + value(primitive, span)
    raise RuntimeError("an orbit came nowhere")


def launch(f: Row, g: Row, saddle: Any, side: int, *, stable: bool) -> tuple[Any, Any]:
    """Return a state on a manifold of a saddle."""
    from mpmath import mpf, sqrt  # noqa: PLC0415

    trace, steep = value(f, saddle), value(slope(g), saddle)
    root = sqrt(trace * trace + 4 * steep)
    rate = (trace - root) / 2 if stable else (trace + root) / 2
    distance = side * mpf(10) ** -16
    return saddle + distance, rate * distance


def miss(f: Row, g: Row, ends: tuple[tuple[Any, int], tuple[Any, int]], section: Any) -> Any:
    """Return by how much a branch of one saddle misses one of another (or the same) on a section."""
    (source, out), (target, back) = ends
    ahead = follow(f, g, launch(f, g, source, out, stable=False), 1, section)
    behind = follow(f, g, launch(f, g, target, back, stable=True), -1, section)
    which = 0 if section is None else 1
    return ahead[which] - behind[which]


def secant(gap: Callable[[Any], Any], guess: float, step: float) -> Any:
    """Return the zero of a smooth function near a guess."""
    from mpmath import mp, mpf  # noqa: PLC0415

    a, b = mpf(guess) - mpf(step), mpf(guess) + mpf(step)
    at_a, at_b = gap(a), gap(b)
    for _ in range(30):
        a, at_a, b = b, at_b, b - at_b * (b - a) / (at_b - at_a)
        if abs(b - a) < mp.mpf(10) ** -24:
            return b
        at_b = gap(b)
    raise RuntimeError("no zero was found")


def cubic_loop(b0: float, guess: float) -> Any:
    """Return the a0 of the homoclinic loop of the nearer saddle."""
    from mpmath import mpf, sqrt  # noqa: PLC0415

    half = mpf(1) / 2
    b = mpf(b0)
    saddle = (-half + sqrt(half * half - 4 * b)) / 2
    ends = (saddle, -1), (saddle, -1)
    return secant(lambda a: miss([a, half, mpf(-1)], [0 * b, b, half, mpf(1)], ends, None), guess, 1e-7)


def neutral_loop(unknown: int) -> Any:
    """Return the b0 (0) or the a0 (1) at which the trace of the saddle vanishes on the loop."""
    from mpmath import mpf, sqrt  # noqa: PLC0415

    half = mpf(1) / 2

    def trace(b0: Any) -> Any:
        saddle = (-half + sqrt(half * half - 4 * b0)) / 2
        return cubic_loop(b0, NEUTRAL_LOOP[1] + 0.1 * (NEUTRAL_LOOP[0] - float(b0))) + half * saddle - saddle**2

    b0 = secant(trace, NEUTRAL_LOOP[0], 1e-6)
    return cubic_loop(b0, NEUTRAL_LOOP[1]) if unknown else b0


def wells(place: tuple[float, float, float], a0: Any) -> tuple[Row, Row]:
    """Return f and g of the system with two wells."""
    from mpmath import mpf  # noqa: PLC0415

    a1, b1, b0 = map(mpf, map(repr, place))
    return [a0, a1, mpf(-1)], [0 * b0, b0, b1, mpf(-1)]


def wells_loop(place: tuple[float, float, float], side: int, turns: int, guess: float) -> Any:
    """Return the a0 of the loop that leaves the saddle to one side and turns so many times."""

    def gap(a0: Any) -> Any:
        f, g = wells(place, a0)
        state = launch(f, g, 0 * a0, side, stable=False)
        for _ in range(turns):
            x, y, _ = follow(f, g, state, 1, None)
            state = x, 0 * y
        arrival = side if turns % 2 else -side
        return state[0] - follow(f, g, launch(f, g, 0 * a0, arrival, stable=True), -1, None)[0]

    return secant(gap, guess, 1e-9)


def unfolding_loop(mu1: float, guess: float) -> Any:
    """Return the μ2 of the homoclinic loop."""
    from mpmath import mpf, sqrt  # noqa: PLC0415

    mu = mpf(mu1)
    ends = (sqrt(-mu), -1), (sqrt(-mu), -1)
    return secant(lambda a: miss([a, mpf(1)], [mu, 0 * mu, mpf(1)], ends, None), guess, 1e-7)


def cycle_fold(field: Callable[[Any], tuple[Row, Row]], guess: float, place: float) -> Any:
    """Return the a0 of the fold of cycles whose right end is near ``place``."""

    def turns(a: Any, x: Any) -> tuple[Any, Any]:
        ways = [follow(*field(a), (x, 0 * x), way, None) for way in (1, -1)]
        return ways[0][0] - ways[1][0], ways[0][2] - ways[1][2]

    def closed(x: Any) -> Any:
        return secant(lambda a: turns(a, x)[0], guess, 1e-7)

    return closed(secant(lambda x: turns(closed(x), x)[1], place, 1e-4))


def between_saddles(a0: Any) -> tuple[Row, Row]:
    """Return f and g of the cubic system at the b0 of its cycles."""
    from mpmath import mpf  # noqa: PLC0415

    half, b = mpf(1) / 2, mpf(CYCLE_B0)
    return [a0, half, mpf(-1)], [0 * b, b, half, mpf(1)]


def aircraft() -> tuple[Row, Row, Any]:
    """Return f, g and the factor of the elevator of the F-8 II, in degrees and seconds."""
    from mpmath import mpf  # noqa: PLC0415

    text = (ROOT / "aircraft" / "f8ii" / "published.toml").read_text(encoding="utf-8")
    tree = tomllib.loads(text, parse_float=mpf)
    z, m = tree["alpha_dot_deg_s"], tree["q_dot_deg_s2"]
    zs = [z["constant"], z["alpha"], z["alpha2"], z["alpha3"]]
    ms = [m["constant"], m["alpha"], m["alpha2"], m["alpha3"]]
    damp = m["q_plus_alpha_dot"]
    f = list(slope(zs))
    f[0] += damp * (1 + z["q"])
    g = [z["q"] * b - damp * a for a, b in zip(zs, ms, strict=True)]
    return f, g, z["q"] * m["elevator"] - damp * z["elevator"]


def aircraft_fold(k: int) -> Any:
    """Return the elevator of a fold, in deg, counted from the lowest."""
    from mpmath import sqrt  # noqa: PLC0415

    _, g, gain = aircraft()
    c, b, a = slope(g)
    turns = [(-b + sign * sqrt(b * b - 4 * a * c)) / (2 * a) for sign in (1, -1)]
    return sorted(-value(g, x) / gain for x in turns)[k]


def aircraft_connection(guess: float, way: int) -> Any:
    """Return the elevator, in deg, of the connection between the saddles with y of the sign ``way``."""
    from mpmath import polyroots  # noqa: PLC0415

    f, g, gain = aircraft()

    def gap(elevator: Any) -> Any:
        pushed = [g[0] + gain * elevator, *g[1:]]
        left, focus, right = sorted(root.real for root in polyroots(pushed[::-1], maxsteps=200, extraprec=200))
        ends = (left, 1), (right, -1)
        return miss(f, pushed, ends if way > 0 else ends[::-1], focus)

    return secant(gap, guess, 1e-6)


def main() -> int:
    """Compute every value again and print it beside the one that stands here; 1 if a digit differs."""
    from mpmath import mp, nstr  # noqa: PLC0415

    mp.dps = DIGITS
    rows: list[tuple[str, float, Callable[[], Any]]] = []
    for b0, a0 in zip(CUBIC_B0, CUBIC_LOOP_A0, strict=True):
        rows.append((f"cubic loop, b0 = {b0:.6g}", a0, partial(cubic_loop, b0, a0)))
    for mu1, mu2 in zip(UNFOLDING_MU1, UNFOLDING_LOOP_MU2, strict=True):
        rows.append((f"unfolding loop, mu1 = {mu1:.6g}", mu2, partial(unfolding_loop, mu1, mu2)))
    meeting = partial(cycle_fold, between_saddles, CYCLE_FOLD_A0, 0.29397690557)
    rows.append(("cubic fold of cycles", CYCLE_FOLD_A0, meeting))
    for k, known in enumerate(NEUTRAL_LOOP):
        rows.append((f"cubic neutral loop, {('b0', 'a0')[k]}", known, partial(neutral_loop, k)))
    for place, a0s in zip(WELLS, WELLS_LOOP_A0, strict=True):
        for (side, turns), a0 in a0s.items():
            rows.append((f"wells {place}, loop {side:+d}", a0, partial(wells_loop, place, side, turns, a0)))
    meeting = partial(cycle_fold, partial(wells, WELLS[0]), WELLS_FOLD_A0, 1.62682572)
    rows.append(("wells, fold of large cycles", WELLS_FOLD_A0, meeting))
    for k, fold in enumerate(FOLD_DEG):
        rows.append((f"F-8 II fold {k + 1}", fold, partial(aircraft_fold, k)))
    for elevator, way in zip(CONNECTION_DEG, (1, -1), strict=True):
        rows.append((f"F-8 II connection {way:+d}", elevator, partial(aircraft_connection, elevator, way)))
    wrong = 0
    for name, stands, again in rows:
        found = again()
        wrong += float(found) != stands
        print(f"{name:32s} {nstr(found, 24):>32s} {stands!r:>24s}", flush=True)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
