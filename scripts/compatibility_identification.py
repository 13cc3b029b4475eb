"""Are the faults of instruments that the kinematic check states the true ones, and are its intervals honest?

A motion in six degrees of freedom (or in the vertical plane) is written down as sums of sines; rates and specific
forces follow by exact differentiation, so that no integrator is common to truth and check. Faults are drawn at half of
their usual sizes, noise and gusts of the air are added, and the check is made for each seed. Prints, for each case,
how often the 95 % intervals of the determined faults and of the combinations hold the truth, how many are determined,
the rms error over the stated one, and false alarms where no instrument has a fault. Exit code 1 if a limit is missed.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray
from finback.dynamics.lienard import NORMAL_95
from finback.errors import RefusedError
from finback.identification.compatibility.check import Compatibility, check_compatibility
from finback.identification.compatibility.fault import ALL, usual_size
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule

GRAVITY: Final = 9.80665
NOISE: Final[Mapping[str, float]] = {
    "p_rad_s": 2e-3,
    "q_rad_s": 1e-3,
    "r_rad_s": 1e-3,
    "ax_m_s2": 0.02,
    "ay_m_s2": 0.02,
    "az_m_s2": 0.05,
    "airspeed_m_s": 0.3,
    "alpha_rad": 2e-3,
    "beta_rad": 2e-3,
    "phi_rad": 1e-3,
    "theta_rad": 1e-3,
    "psi_rad": 1e-3,
    "altitude_m": 1.0,
}
"""Of good flight-test instruments, in SI."""
PLANE: Final = ("q_rad_s", "ax_m_s2", "az_m_s2", "airspeed_m_s", "alpha_rad", "theta_rad")
LIMITS: Final = (0.90, 0.99)  # of each fault's coverage
POOLED: Final = (0.93, 0.97)
FALSE_ALARMS: Final = 0.07  # of faults called significant that are not there
FEW: Final = 0.5  # of the seeds: a fault that is determined less often is counted in the pool alone


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """How a flight is flown and measured.

    Attributes:
        plane: in the vertical plane, without lateral channels.
        faults: of the usual sizes, of which faults are drawn.
        duration_s: of the record.
        rate_hz: samples a second.
        noise: of the usual noise.
        gust_m_s: standard deviation of each component of the air's velocity.
        gust_s: its correlation time.
        wind_up_m_s: how fast the air rises.
        altitude: whether the altitude is recorded.
    """

    plane: bool = False
    faults: float = 0.5
    duration_s: float = 20.0
    rate_hz: float = 50.0
    noise: float = 1.0
    gust_m_s: float = 0.0
    gust_s: float = 1.0
    wind_up_m_s: float = 0.0
    altitude: bool = False


CASES: Final[Mapping[str, Case]] = {
    "six degrees, still air": Case(),
    "six degrees, no faults": Case(faults=0.0),
    "six degrees, altitude, rising air": Case(altitude=True, wind_up_m_s=2.0),
    "vertical plane, still air": Case(plane=True),
    "vertical plane, 25 Hz, 5 x noise": Case(plane=True, rate_hz=25.0, noise=5.0, duration_s=40.0),
    "six degrees, gusts 0.5 m/s, 1 s": Case(gust_m_s=0.5),
    "vertical plane, gusts 1 m/s, 1 s": Case(plane=True, gust_m_s=1.0, duration_s=40.0),
    "six degrees, gusts 2 m/s, 3 s": Case(gust_m_s=2.0, gust_s=3.0),
}


@final
@dataclass(frozen=True, slots=True)
class Sines:
    """A mean and sines (amplitude, frequency in rad/s, phase), with their derivative."""

    mean: float
    terms: tuple[tuple[float, float, float], ...] = ()

    def __call__(self, time: FloatArray) -> FloatArray:
        """Return the value, shape of time."""
        return self.mean + sum((a * np.sin(w * time + c) for a, w, c in self.terms), np.zeros_like(time))

    def rate(self, time: FloatArray) -> FloatArray:
        """Return the derivative by time."""
        return sum((a * w * np.cos(w * time + c) for a, w, c in self.terms), np.zeros_like(time))


def _motion(*, plane: bool) -> tuple[Sines, ...]:
    """Return airspeed, alpha, beta, phi, theta, psi over time, in SI."""
    speed = Sines(100.0, ((8.0, 0.31, 0.2), (1.5, 0.9, 1.0)))
    alpha = Sines(0.08, ((0.05, 2.0, 0.0), (0.02, 5.0, 0.5), (0.02, 0.5, 1.0)))
    theta = Sines(0.08, ((0.12, 0.33, 0.2), (0.06, 1.9, 0.6), (0.015, 5.0, 0.1)))
    if plane:
        return speed, alpha, Sines(0.0), Sines(0.0), theta, Sines(0.0)
    beta = Sines(0.0, ((0.04, 1.6, 0.3), (0.01, 3.0, 1.0)))
    phi = Sines(0.0, ((0.6, 0.8, 0.0), (0.2, 1.7, 0.4)))
    psi = Sines(0.5, ((0.5, 0.4, 0.9), (0.05, 1.5, 0.2)))
    return speed, alpha, beta, phi, theta, psi


def true_values(time: FloatArray, *, plane: bool) -> dict[str, FloatArray]:
    """Return every channel at some times, and u, v, w, and the rate of climb through the air (``climb``), in SI."""
    speed, alpha, beta, phi, theta, psi = _motion(plane=plane)
    sa, ca, sb, cb = np.sin(alpha(time)), np.cos(alpha(time)), np.sin(beta(time)), np.cos(beta(time))
    sp, cp, st, ct = np.sin(phi(time)), np.cos(phi(time)), np.sin(theta(time)), np.cos(theta(time))
    v_dot, a_dot, b_dot = speed.rate(time), alpha.rate(time), beta.rate(time)
    total = speed(time)
    u, v, w = total * cb * ca, total * sb, total * cb * sa
    u_dot = v_dot * cb * ca - total * (sb * b_dot * ca + cb * sa * a_dot)
    v_side = v_dot * sb + total * cb * b_dot
    w_dot = v_dot * cb * sa + total * (cb * ca * a_dot - sb * b_dot * sa)
    p = phi.rate(time) - st * psi.rate(time)
    q = cp * theta.rate(time) + sp * ct * psi.rate(time)
    r = cp * ct * psi.rate(time) - sp * theta.rate(time)
    return {
        "p_rad_s": p,
        "q_rad_s": q,
        "r_rad_s": r,
        "ax_m_s2": u_dot + q * w - r * v + GRAVITY * st,
        "ay_m_s2": v_side + r * u - p * w - GRAVITY * ct * sp,
        "az_m_s2": w_dot + p * v - q * u - GRAVITY * ct * cp,
        "airspeed_m_s": total,
        "alpha_rad": alpha(time),
        "beta_rad": beta(time),
        "phi_rad": phi(time),
        "theta_rad": theta(time),
        "psi_rad": psi(time),
        "u": u,
        "v": v,
        "w": w,
        "climb": u * st - v * sp * ct - w * cp * ct,
    }


def flight(seed: int, case: Case, faults: Mapping[str, float]) -> FlightRecord:
    """Measure a flight with faults of the instruments, by their names, in SI."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, case.duration_s, 1.0 / case.rate_hz)
    air = np.stack([_gusts(random, time, case) for _ in range(3)])
    names = PLANE if case.plane else tuple(name for name in NOISE if name != "altitude_m")
    columns = {"time_s": time}
    for name in (*names, *(("altitude_m",) if case.altitude else ())):
        quantity = name.split("_", maxsplit=1)[0]
        late = time - faults.get(f"{quantity} delay", 0.0)
        values = _altitude(late, case) if name == "altitude_m" else _felt(late, name, air, plane=case.plane)
        values = (1.0 + faults.get(f"{quantity} scale", 0.0)) * values + faults.get(f"{quantity} bias", 0.0)
        columns[name] = values + case.noise * NOISE[name] * random.standard_normal(time.size)
    return FlightRecord(
        name=f"seed {seed}",
        columns=columns,
        outcome=Outcome.COMPLETED,
        note="",
        condition=Condition(airspeed_m_s=100.0, density_kg_m3=1.0, gravity_m_s2=GRAVITY, altitude_m=0.0),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.zeros(1)),
        hold=Hold.FOH,
    )


def _felt(time: FloatArray, name: str, air: FloatArray, *, plane: bool) -> FloatArray:
    """Return a channel, the flow's as it is in moving air."""
    true = true_values(time, plane=plane)
    u, v, w = true["u"] - air[0], true["v"] - air[1], true["w"] - air[2]
    speed = np.sqrt(u * u + v * v + w * w)
    flow = {"airspeed_m_s": speed, "alpha_rad": np.arctan2(w, u), "beta_rad": np.arcsin(v / speed)}
    return flow[name] if name in flow else true[name]


def _altitude(time: FloatArray, case: Case) -> FloatArray:
    """Integrate the rate of climb by Simpson's rule on steps of 2 ms."""
    fine = np.linspace(-1.0, case.duration_s + 1.0, 2 * round(250 * (case.duration_s + 2.0)) + 1)
    middle = 0.5 * (fine[1:] + fine[:-1])
    ends, half = (true_values(at, plane=case.plane)["climb"] for at in (fine, middle))
    steps = np.diff(fine) / 6.0 * (ends[:-1] + 4.0 * half + ends[1:])
    height = 1000.0 + np.concatenate([[0.0], np.cumsum(steps)]) + case.wind_up_m_s * fine
    return np.asarray(np.interp(time, fine, height))


def _gusts(random: np.random.Generator, time: FloatArray, case: Case) -> FloatArray:
    draws = random.standard_normal(time.size)
    if case.gust_m_s == 0.0:
        return np.zeros(time.size)
    memory = np.exp(-1.0 / case.rate_hz / case.gust_s)
    found = np.empty(time.size)
    state = draws[0]
    for k in range(time.size):
        found[k] = state
        state = memory * state + np.sqrt(1.0 - memory**2) * draws[k]
    return np.asarray(case.gust_m_s * found)


def drawn(seed: int, share: float) -> dict[str, float]:
    """Draw every fault at a share of its usual size."""
    random = np.random.default_rng([seed, 1])
    return {fault.name: share * usual_size(fault) * float(random.standard_normal()) for fault in ALL}


@final
class Tally:
    """What the seeds of a case gave."""

    def __init__(self) -> None:
        self.held: dict[str, list[float]] = defaultdict(list)
        self.combined: list[bool] = []
        self.alarms = self.refused = self.halved = 0
        self.undetermined: Counter[str] = Counter()

    def add(self, found: Compatibility, truth: Mapping[str, float]) -> None:
        """Count one check."""
        for error in found.errors:
            if error.known:
                self.held[error.name].append((error.value - truth[error.name]) / error.standard_error)
                self.alarms += error.significant
            else:
                self.undetermined[error.name] += 1
        for one in found.combinations:
            true = sum(weight * truth[name] for weight, name in zip(one.weights, one.names, strict=True))
            self.combined.append(abs(one.value - true) <= NORMAL_95 * one.standard_error)
        self.halved += any("do not tell one motion" in note for note in found.not_checked)

    def report(self, name: str, seeds: int, *, faultless: bool) -> bool:
        """Print the case; return whether its limits are kept."""
        inside = {key: np.abs(np.array(off)) <= NORMAL_95 for key, off in self.held.items()}
        pooled = float(np.mean(np.concatenate(list(inside.values()))))
        often = {key: float(hits.mean()) for key, hits in inside.items() if hits.size >= FEW * seeds}
        ratio = float(np.sqrt(np.mean(np.square(np.concatenate([np.array(off) for off in self.held.values()])))))
        worst, best = min(often, key=lambda key: often[key]), max(often, key=lambda key: often[key])
        # Chance alone moves a share of so many seeds by this much (two standard deviations).
        slack = 2.0 * float(np.sqrt(0.05 * 0.95 / seeds))
        fine = LIMITS[0] - slack <= often[worst] and POOLED[0] <= pooled
        print(f"{name}: {seeds} seeds, {self.refused} refused, {self.halved} judged by attitudes alone")
        print(
            f"  determined faults: covered {pooled:.3f} pooled, {often[worst]:.3f} ({worst}) to {often[best]:.3f}; "
            f"rms error / stated {ratio:.2f}"
        )
        if self.combined:
            print(f"  known only together: {len(self.combined)} sums, covered {np.mean(self.combined):.3f}")
        if self.undetermined:
            print(f"  not determined alone: {', '.join(f'{key} {n}' for key, n in self.undetermined.most_common())}")
        if faultless:
            share = self.alarms / sum(hits.size for hits in inside.values())
            print(f"  called significant though not there: {share:.3f}")
            fine &= share <= FALSE_ALARMS
        print(f"  {'kept' if fine else 'MISSED'}", flush=True)
        return fine


def study(name: str, case: Case, seeds: int) -> bool:
    """Check a case over seeds; return whether its limits are kept."""
    tally = Tally()
    for seed in range(seeds):
        truth = drawn(seed, case.faults)
        try:
            tally.add(check_compatibility([flight(seed, case, truth)]), truth)
        except RefusedError:
            tally.refused += 1
    return tally.report(name, seeds, faultless=case.faults == 0.0)


def main() -> int:
    """Run all cases."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=200, metavar="N", help="number of seeds (200)")
    parser.add_argument("--only", default="", metavar="TEXT", help="cases whose name holds this")
    options = parser.parse_args()
    kept = [study(name, case, options.seeds) for name, case in CASES.items() if options.only in name]
    return 0 if all(kept) else 1


if __name__ == "__main__":
    sys.exit(main())
