"""AUTO-07p's side of the benchmarks, through bifpy, which carries AUTO's engine.

bifpy translates each model to Fortran, compiles it, and runs AUTO as a program. Timed is that program alone, with its
input ready: no Python, no compilation, no reading of results, and no output but the last point. Connecting orbits are
begun from an orbit that scipy has integrated beforehand, which is not timed either.
"""

from __future__ import annotations

import math
import subprocess
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import bench_reference as reference
import numpy as np
from bench_task import Score, Side
from bifpy import auto
from scipy.integrate import solve_ivp

NAME: Final = "AUTO-07p"
FAR: Final = 1e9
DISCRETIZATION: Final = {"ndim": 2, "npar": 20, "ntst": 50, "ncol": 4, "iad": 3, "jac": 0}
OUTPUT: Final = {"ilp": 0, "isp": 0, "isw": 1, "iplt": 0, "npr": 10_000, "mxbf": 0, "iid": 0}
NEWTON: Final = {"itmx": 8, "itnw": 7, "nwtn": 3, "epsl": 1e-9, "epsu": 1e-9, "epss": 1e-7}
STEPS: Final = {"iads": 1, "dsmin": 1e-5, "rl0": -FAR, "rl1": FAR, "a0": -FAR, "a1": FAR}
BASE: Final = {**DISCRETIZATION, **OUTPUT, **NEWTON, **STEPS}
HOMCONT: Final = {**BASE, "ips": auto.IPS_HOMCONT, "istart": 1, "itwist": 0, "nunstab": 1, "nstab": 1}
FAST: Final = {"transpile": True, "keep_output": True}
OFFSET: Final = 1e-5  # from the saddle, where the first orbit begins: longer ones cost AUTO time, shorter ones accuracy
SAMPLES: Final = 150

Field = Callable[[Any, Any], list[Any]]
State = tuple[float, float]


def side(chain: Callable[[], Sequence[Any]], score: Callable[[Sequence[Any]], Score]) -> Side:
    """Run a chain of bifpy calls once; return a side that runs only AUTO's programs again."""
    begun = time.perf_counter()
    results = chain()
    call_ms = 1e3 * (time.perf_counter() - begun)
    folders = [Path(result.output_directory) for result in results]

    def run() -> Sequence[Any]:
        for folder in folders:
            subprocess.run([str(folder / "model_exe")], cwd=folder, stdout=subprocess.DEVNULL, check=True)  # noqa: S603 - just built
        return results

    return Side(name=NAME, run=run, score=score, call_ms=call_ms)


def points(result: Any) -> Any:
    """Return the points of the only branch of a result."""
    return result.branches[0].points


def special(result: Any, kind: Any) -> Any:
    """Return the first point of a kind."""
    return next(point for point in points(result) if point.point_type is kind)


def cubic(u: Any, p: Any) -> list[Any]:
    """Return the field of the cubic system in PAR(1) = a0, PAR(2) = b0."""
    x, y = u
    return [y, (-(x**2) + 0.5 * x + p[0]) * y + (x**2 + 0.5 * x + p[1]) * x]


def unfolding(u: Any, p: Any) -> list[Any]:
    """Return the field of the unfolding in PAR(1) = μ1, PAR(2) = μ2."""
    x, y = u
    return [y, (p[1] + x) * y + p[0] + x * x]


def aircraft() -> tuple[Field, Sequence[float], Sequence[float], float]:
    """Return the field of the F-8 II in degrees, PAR(1) the elevator; f, g and the factor of the elevator."""
    f, g, gain = (np.array(part, dtype=np.float64) for part in reference.aircraft())
    f0, f1, f2 = map(float, f)
    g0, g1, g2, g3 = map(float, g)
    c = float(gain)

    def field(u: Any, p: Any) -> list[Any]:
        x, y = u
        return [y, (f0 + (f1 + f2 * x) * x) * y + g0 + (g1 + (g2 + g3 * x) * x) * x + c * p[0]]

    return field, f.tolist(), g.tolist(), c


def orbit(field: Field, par: Sequence[float], legs: Sequence[tuple[State, State]], section: tuple[int, float]) -> Any:
    """Integrate from both ends to a section (number of the state, value); return times and states of the whole."""

    def event(_: float, u: Any) -> float:
        return float(u[section[0]] - section[1])

    event.terminal = True  # type: ignore[attr-defined]  # scipy asks for it
    halves = []
    for (place, rate), way in zip(legs, (1, -1), strict=True):
        start = [a + OFFSET * b for a, b in zip(place, rate, strict=True)]
        halves.append(
            solve_ivp(
                lambda _, u: field(u, par),
                (0.0, way * 200.0),
                start,
                method="DOP853",
                rtol=1e-11,
                atol=1e-12,
                events=event,
                dense_output=True,
            )
        )
    ahead, behind = halves
    first, second = np.linspace(0.0, ahead.t[-1], SAMPLES), np.linspace(behind.t[-1], 0.0, SAMPLES)[1:]
    assert ahead.sol is not None
    assert behind.sol is not None
    times = np.concatenate([first, ahead.t[-1] + second - behind.t[-1]])
    return times.tolist(), np.vstack([ahead.sol(first).T, behind.sol(second).T]).tolist()


def rates(f: Sequence[float], g: Sequence[float], x: float) -> tuple[float, float]:
    """Return the eigenvalues at a saddle of x' = y, y' = f y + g, the growing one first."""
    trace, steep = reference.value(f, x), reference.value(reference.slope(g), x)
    root = math.sqrt(trace * trace + 4.0 * steep)
    return (trace + root) / 2.0, (trace - root) / 2.0


def homoclinic(field: Field, par: Sequence[float], f: Sequence[float], g: Sequence[float], **options: Any) -> Any:
    """Continue the loop to the left of the rightmost equilibrium; ``icu`` and AUTO's constants in the options."""
    saddle = float(max(np.roots(g[::-1]).real))
    out, back = rates(f, g, saddle)
    times, states = orbit(field, par, (((saddle, 0.0), (-1.0, -out)), ((saddle, 0.0), (-1.0, -back))), (1, 0.0))

    def start(_: Any, p: Any, __: Any) -> None:
        p[0], p[1], p[10], p[11], p[12] = *par, times[-1], saddle, 0.0

    icu = options.pop("icu")
    return auto.run(field, start, {**HOMCONT, "iequib": 1, **options}, icu=icu, dat=(times, states), **FAST)


def cubic_homoclinic(b0: float, a0: float, **options: Any) -> Any:
    """Continue the homoclinic loop of the cubic system in b0."""
    return homoclinic(cubic, (a0, b0), (a0, 0.5, -1.0), (0.0, b0, 0.5, 1.0), icu=[2, 1], **options)


def unfolding_homoclinic(mu1: float, mu2: float, **options: Any) -> Any:
    """Continue the homoclinic loop of the unfolding in μ1."""
    return homoclinic(unfolding, (mu1, mu2), (mu2, 1.0), (mu1, 0.0, 1.0), icu=[1, 2], **options)


def heteroclinic(start_deg: float, way: int) -> Any:
    """Correct a rough connection of the F-8 II: PAR(2) is free and does nothing, so that a step solves anew."""
    field, f, g, gain = aircraft()
    pushed = [g[0] + gain * start_deg, *g[1:]]
    left, focus, right = sorted(np.roots(pushed[::-1]).real.tolist())
    source, target = (left, right) if way > 0 else (right, left)
    out, back = rates(f, pushed, source)[0], rates(f, pushed, target)[1]
    legs = ((source, 0.0), (float(way), way * out)), ((target, 0.0), (float(-way), -way * back))
    times, states = orbit(field, (start_deg,), legs, (0, focus))

    def start(_: Any, p: Any, __: Any) -> None:
        p[0], p[1], p[10], p[11], p[12], p[13], p[14] = start_deg, 0.0, times[-1], source, 0.0, target, 0.0

    options = {"iequib": -2, "ntst": 60, "nmx": 2, "ds": 0.01, "dsmax": 0.1}
    return auto.run(field, start, {**HOMCONT, **options}, icu=[2, 1], dat=(times, states), **FAST)


def branch(begin_x: float, limits: tuple[float, float]) -> list[Any]:
    """Continue the equilibria of the F-8 II both ways, from those at one angle in deg."""
    field, _, g, gain = aircraft()

    def start(u: Any, p: Any, _: Any) -> None:
        u[0], u[1], p[0] = begin_x, 0.0, -reference.value(g, begin_x) / gain

    options = {"ips": auto.IPS_EQUILIBRIUM, "isp": 1, "ilp": 1, "nmx": 300, "dsmax": 4.0}
    return [
        auto.run(field, start, {**BASE, **options, "ds": ds}, icu=[1], uzstop={1: list(limits)}, **FAST)
        for ds in (0.5, -0.5)
    ]


def to_hopf(b0: float) -> Any:
    """Continue the equilibrium at the origin of the cubic system from a0 = −0.0517 through its Hopf point."""

    def start(u: Any, p: Any, _: Any) -> None:
        u[0], u[1], p[0], p[1] = 0.0, 0.0, -0.0517, b0

    options = {"ips": auto.IPS_EQUILIBRIUM, "isp": 1, "nmx": 40, "ds": 0.01, "dsmax": 0.05, "rl1": 0.05}
    return auto.run(cubic, start, {**BASE, **options}, icu=[1], **FAST)


def cycles(b0: float, longest: float) -> list[Any]:
    """Continue the cycles of the cubic system from its Hopf point to a period, past their fold."""
    equilibria = to_hopf(b0)
    hopf = special(equilibria, auto.PointType.HOPF_BIFURCATION)
    options = {"ips": auto.IPS_PERIODIC_ORBIT, "ilp": 1, "nmx": 400, "ds": 0.01, "dsmax": 0.3}
    family = auto.restart(cubic, {**BASE, **options}, hopf, icu=[1, 11], isw=-1, uzstop={11: longest}, **FAST)
    return [equilibria, family]


def cycle_folds(family: Any, limits: tuple[float, float]) -> list[Any]:
    """Continue the fold of cycles of a family in b0 both ways; AUTO needs a run of its own to begin it."""
    fold = special(family, auto.PointType.FOLD)
    options = {**BASE, "ips": auto.IPS_PERIODIC_ORBIT, "nmx": 200, "dsmax": 0.5}
    locus = {"icu": [1, 2, 11], "isw": 2, **FAST}
    begin = auto.restart(cubic, {**options, "nmx": 5, "ds": 0.02}, fold, **locus)
    ways = [
        auto.restart(cubic, {**options, "ds": ds}, points(begin)[-1], uzstop={2: list(limits)}, **locus)
        for ds in (0.05, -0.05)
    ]
    return [begin, *ways]


def hopf_curve(equilibria: Any, limits: tuple[float, float]) -> list[Any]:
    """Continue the Hopf point in b0 both ways."""
    hopf = special(equilibria, auto.PointType.HOPF_BIFURCATION)
    options = {**BASE, "ips": auto.IPS_EQUILIBRIUM, "nmx": 60, "dsmax": 0.2}
    return [
        auto.restart(cubic, {**options, "ds": ds}, hopf, icu=[1, 2], isw=2, uzstop={2: list(limits)}, **FAST)
        for ds in (0.05, -0.05)
    ]
