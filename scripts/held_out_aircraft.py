"""Aircraft on which no threshold was set: a business jet, a transport whose flow lags at the stall, an unmanned one.

Longitudinal motion in four states and the separation point, forces of lift, drag and moment linear in alpha, q and the
elevator, through vertical and longitudinal Dryden gusts. The stall is Kirchhoff's flow with a separation point that
lags (Goman and Khrabrov 1994, J. Aircraft 31(5)). The sensors round what they measure.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final, final

import numpy as np
from scipy.optimize import fsolve

from finback.arrays import FloatArray
from finback.dynamics.compiled import compiled
from finback.flight.air import DrydenAir
from finback.flight.turbulence import dryden_gusts
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule
from finback.units import to_si

GRAVITY: Final = 9.80665
STEP_S: Final = 0.005


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Airplane:
    """Constants of one aircraft.

    Attributes:
        speed_m_s: of the trim.
        density_kg_m3: of the air.
        area_over_mass: wing area over mass, m²/kg.
        moment_scale: wing area times chord over the moment of inertia, 1/kg · m.
        chord_m: of the wing.
        lift: CL = lift · (1, V/V0, alpha, q c/2V, elevator), shape (5,).
        drag: CD = drag · (1, V/V0, alpha, alpha², share of the flow that has separated), shape (5,).
        moment: Cm = moment · (1, V/V0, alpha, q c/2V0, elevator, share that has separated), shape (6,).
        stall_rad: alpha of half the separation; 1.5 for none.
        steepness: of the separation over alpha, 1/rad.
        relaxation_s: time constant of the separation point.
        lag_chords: by how many chords of travel the separation lags with dα/dt.
    """

    speed_m_s: float
    density_kg_m3: float
    area_over_mass: float
    moment_scale: float
    chord_m: float
    lift: tuple[float, ...]
    drag: tuple[float, ...]
    moment: tuple[float, ...]
    stall_rad: float = 1.5
    steepness: float = 20.0
    relaxation_s: float = 0.02
    lag_chords: float = 0.0

    @property
    def values(self) -> FloatArray:
        """All constants in a row, for the kernel."""
        return np.array(
            [
                self.speed_m_s, self.density_kg_m3, self.area_over_mass, self.moment_scale, self.chord_m,
                self.stall_rad, self.steepness, self.relaxation_s, self.lag_chords,
                *self.lift, *self.drag, *self.moment,
            ]
        )  # fmt: skip


JET: Final = Airplane(
    speed_m_s=104.67, density_kg_m3=0.792, area_over_mass=4.028e-3, moment_scale=8.0027e-4, chord_m=2.43,
    lift=(-0.1, 0.155, 4.4, 0.0, 0.0), drag=(0.124, -0.065, 0.32, 0.0, 0.0),
    moment=(0.108, 0.01, -1.0, -45.0 * 2.0 / 2.43, -1.6, 0.0),
)  # fmt: skip
"""Mass 7.5 t; of the size of the published results for the HFB-320 (Jategaonkar 2006)."""
TRANSPORT: Final = Airplane(
    speed_m_s=95.0, density_kg_m3=0.96, area_over_mass=64.0 / 17500.0, moment_scale=64.0 * 3.2 / 4.5e5, chord_m=3.2,
    lift=(0.12, 0.0, 5.0, 6.0, 0.3), drag=(0.035, 0.0, 0.0, 1.1, 0.08),
    moment=(0.1, 0.0, -1.2, -20.0, -1.5, -0.05),
)  # fmt: skip
"""17.5 t, straight wings; with ``stalling`` its flow separates."""
UNMANNED: Final = Airplane(
    speed_m_s=20.0, density_kg_m3=1.2, area_over_mass=0.7 / 13.0, moment_scale=0.7 * 0.22 / 1.1, chord_m=0.22,
    lift=(0.25, 0.0, 4.6, 6.0, 0.35), drag=(0.035, 0.0, 0.0, 1.0, 0.0),
    moment=(0.05, 0.0, -0.6, -12.0, -0.9, 0.0),
)  # fmt: skip
"""13 kg."""


def stalling(stall_deg: float, steepness: float, relaxation_s: float, lag_chords: float) -> Airplane:
    """Return the transport with a flow that separates."""
    return replace(
        TRANSPORT, stall_rad=to_si(stall_deg, "deg"), steepness=steepness, relaxation_s=relaxation_s,
        lag_chords=lag_chords,
    )  # fmt: skip


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Sensing:
    """What the sensors do: white noise, then rounding, both in SI.

    Attributes:
        noise: standard deviations of airspeed, alpha, pitch angle, q, ax and az, shape (6,).
        steps: to which the same are rounded; 0 for none.
    """

    noise: tuple[float, ...]
    steps: tuple[float, ...] = (0.0,) * 6


LOGGER: Final = Sensing(noise=(0.04, 2e-4, 1e-4, 3e-4, 0.02, 0.05), steps=(0.04, 1e-4, 1.8e-4, 3.4e-4, 0.0, 0.0))
TENTH: Final = Sensing(
    noise=(0.1, to_si(0.1, "deg"), to_si(0.05, "deg"), to_si(0.1, "deg"), 0.02 * GRAVITY, 0.02 * GRAVITY)
)
CHEAP: Final = Sensing(
    noise=(0.3, to_si(0.3, "deg"), to_si(0.3, "deg"), to_si(0.3, "deg"), 0.05 * GRAVITY, 0.05 * GRAVITY)
)


@compiled
def _rates(
    state: FloatArray, elevator: float, thrust: float, gust: FloatArray, p: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return rates of (u, w, q, theta, attached share) and what is measured: V, alpha, theta, q, ax, az."""
    u, w, q, theta, attached = state
    along, down = u + gust[0], w + gust[1]
    speed = np.sqrt(along * along + down * down)
    alpha = np.arctan2(down, along)
    lift, drag, moment = p[9:14], p[14:19], p[19:25]
    flow = (0.5 * (1.0 + np.sqrt(min(max(attached, 0.0), 1.0)))) ** 2
    turned, faster = 0.5 * p[4] * q / speed, speed / p[0]
    cl = lift[0] + lift[1] * faster + lift[2] * flow * alpha + lift[3] * turned + lift[4] * elevator
    cd = drag[0] + drag[1] * faster + drag[2] * alpha + drag[3] * alpha * alpha + drag[4] * (1.0 - attached)
    cm = (
        moment[0] + moment[1] * faster + moment[2] * alpha + moment[3] * 0.5 * p[4] * q / p[0]
        + moment[4] * elevator + moment[5] * (1.0 - attached)
    )  # fmt: skip
    pressure = 0.5 * p[1] * speed * speed
    ax = pressure * p[2] * (cl * np.sin(alpha) - cd * np.cos(alpha)) + thrust
    az = pressure * p[2] * (-cl * np.cos(alpha) - cd * np.sin(alpha))
    du = ax - GRAVITY * np.sin(theta) - q * w
    dw = az + GRAVITY * np.cos(theta) + q * u
    found = np.array([du, dw, pressure * p[3] * cm, q, 0.0])
    rate = (dw * along - du * down) / (speed * speed)
    steady = 0.5 * (1.0 - np.tanh(p[6] * (alpha - p[8] * p[4] / speed * rate - p[5])))
    found[4] = (steady - attached) / p[7]
    return found, np.array([speed, alpha, theta, q, ax, az])


@compiled
def _flown(  # noqa: PLR0913, PLR0917 - a kernel takes its arrays one by one
    start: FloatArray,
    elevator: FloatArray,
    wanted: FloatArray,
    gains: FloatArray,
    thrust: FloatArray,
    gusts: FloatArray,
    p: FloatArray,
    step: float,
) -> tuple[FloatArray, FloatArray]:
    """Integrate by Runge and Kutta's rule; a pilot follows alpha with his gains. Elevator and gust are straight."""
    found, moved = np.empty((elevator.size, 6)), np.empty(elevator.size)
    state, now = start.copy(), elevator[0]
    for i in range(elevator.size):
        found[i], moved[i] = _rates(state, now, thrust[i], gusts[i], p)[1], now
        k = min(i + 1, elevator.size - 1)
        after = elevator[k] + gains[0] * (found[i, 1] - wanted[k]) + gains[1] * found[i, 3]
        after = min(max(after, now - step * 0.7), now + step * 0.7)
        middle, between = 0.5 * (now + after), 0.5 * (gusts[i] + gusts[k])
        one = _rates(state, now, thrust[i], gusts[i], p)[0]
        two = _rates(state + 0.5 * step * one, middle, thrust[i], between, p)[0]
        three = _rates(state + 0.5 * step * two, middle, thrust[i], between, p)[0]
        four = _rates(state + step * three, after, thrust[i], gusts[k], p)[0]
        state = state + step / 6.0 * (one + 2.0 * two + 2.0 * three + four)
        now = after
    return found, moved


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """What is flown.

    Attributes:
        rate_hz: samples a second.
        elevator_rad: about the trim, each 5 ms.
        wanted_rad: alpha about the trim that a pilot follows, each 5 ms; empty for none.
        push_m_s2: thrust over mass about the trim, likewise.
        gust_m_s: standard deviation of the gusts; 0 in calm air.
        length_m: their scale length.
    """

    rate_hz: int
    elevator_rad: FloatArray
    wanted_rad: FloatArray = field(default_factory=lambda: np.empty(0))
    push_m_s2: FloatArray = field(default_factory=lambda: np.empty(0))
    gust_m_s: float = 0.0
    length_m: float = 300.0


def fly(airplane: Airplane, mission: Mission, sensing: Sensing, *, seed: int, name: str = "flight") -> FlightRecord:
    """Fly from a level trim and measure."""
    values, count = airplane.values, mission.elevator_rad.size
    speed = airplane.speed_m_s
    calm = np.zeros(2)

    def start(alpha: float) -> FloatArray:
        attached = 0.5 * (1.0 - np.tanh(airplane.steepness * (alpha - airplane.stall_rad)))
        return np.array([speed * np.cos(alpha), speed * np.sin(alpha), 0.0, alpha, attached])

    def level(guess: FloatArray) -> FloatArray:
        return np.asarray(_rates(start(guess[0]), guess[1], guess[2], calm, values)[0][:3])

    alpha, trim, thrust = fsolve(level, np.array([0.1, 0.0, 1.0]), xtol=1e-12)
    gusts = np.zeros((count, 2))
    if mission.gust_m_s > 0.0:
        air = DrydenAir(intensity_m_s=mission.gust_m_s, length_m=mission.length_m, seed=seed)
        gusts = dryden_gusts(air, airspeed_m_s=speed, step_s=STEP_S, steps=count - 1)[:, [0, 2]]
    followed, pushed = mission.wanted_rad.size > 0, mission.push_m_s2.size > 0
    relative = mission.wanted_rad if followed else np.zeros(count)
    forward = -airplane.moment[2] / airplane.moment[4] * relative
    table, moved = _flown(
        start(alpha), trim + forward + mission.elevator_rad, alpha + relative,
        np.array([1.0, 0.9]) if followed else np.zeros(2), thrust + (mission.push_m_s2 if pushed else np.zeros(count)),
        np.ascontiguousarray(gusts), values, STEP_S,
    )  # fmt: skip
    stride = round(1.0 / (mission.rate_hz * STEP_S))
    seen = table[::stride].copy()
    random = np.random.default_rng(seed + 77)
    seen += np.array(sensing.noise) * random.standard_normal(seen.shape)
    for column, step in enumerate(sensing.steps):
        if step > 0.0:
            seen[:, column] = step * np.round(seen[:, column] / step)
    names = ("airspeed_m_s", "alpha_rad", "theta_rad", "q_rad_s", "ax_m_s2", "az_m_s2")
    return FlightRecord(
        name=name,
        columns={
            "time_s": np.arange(len(seen)) / mission.rate_hz,
            "elevator_rad": moved[::stride],
            **dict(zip(names, seen.T.copy(), strict=True)),
        },
        outcome=Outcome.COMPLETED,
        note="",
        hold=Hold.FOH,
        condition=Condition(
            airspeed_m_s=speed, density_kg_m3=airplane.density_kg_m3, gravity_m_s2=GRAVITY, altitude_m=3000.0
        ),
        schedule=Schedule(time_s=np.zeros(1), elevator_rad=np.full(1, trim)),
    )


def clock(duration_s: float) -> FloatArray:
    """Return times each 5 ms."""
    return np.asarray(STEP_S * np.arange(round(duration_s / STEP_S) + 1), dtype=np.float64)


def steps(
    duration_s: float, unit_s: float, amplitude_deg: float, *, starts_s: tuple[float, ...] = (2.0,)
) -> FloatArray:
    """Return 3-2-1-1 inputs in rad, each edge over 0.1 s."""
    time, found = clock(duration_s), np.zeros(round(duration_s / STEP_S) + 1)
    for start in starts_s:
        knots = start + unit_s * np.array([0.0, 3.0, 5.0, 6.0, 7.0])
        times = np.stack([knots, knots + 0.1], axis=1).ravel()
        found += np.interp(time, times, [0.0, 1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 0.0])
    return np.asarray(to_si(amplitude_deg, "deg") * found)


def slow_stalls(
    airplane: Airplane, *, entries: int, beyond_deg: float, top_deg: float, seed: int, rate_m_s2: float = 0.5
) -> Mission:
    """Return a mission of slow decelerations to ``top_deg + beyond_deg`` of alpha and recoveries with power.

    Args:
        airplane: which one.
        entries: how many.
        beyond_deg: how far beyond ``top_deg`` alpha goes; negative to stay below.
        top_deg: alpha of the stall.
        seed: of the pilot's small corrections.
        rate_m_s2: loss of airspeed.
    """
    random = np.random.default_rng(seed)
    wanted, push = [], []
    slope = airplane.lift[2]
    level = GRAVITY / (0.5 * airplane.density_kg_m3 * airplane.speed_m_s**2 * airplane.area_over_mass)
    for _ in range(entries):
        top = to_si(top_deg + beyond_deg + random.uniform(-0.5, 0.5), "deg") - (level - airplane.lift[0]) / slope
        fastest = airplane.speed_m_s
        slowest = fastest / np.sqrt(1.0 + top * slope / level)
        pull = clock((fastest - slowest) / rate_m_s2)
        rise = level / slope * ((fastest / (fastest - rate_m_s2 * pull)) ** 2 - 1.0)
        after = clock(random.uniform(20.0, 26.0))
        back = top * np.interp(after, [0.0, 1.5, 4.0, 9.0], [1.0, 1.0, 0.1, 0.0])
        wanted += [np.full(400, 0.0), np.clip(rise, 0.0, top), back]
        more = (fastest - slowest) / 20.0
        push += [
            np.zeros(400),
            np.full(pull.size, -rate_m_s2),
            np.interp(after, [0.0, 2.0, 4.0, 18.0, 20.0], [-0.3, -0.3, more, more, 0.0]),
        ]
    alpha = np.concatenate(wanted)
    time = STEP_S * np.arange(alpha.size)
    for frequency in (0.17, 0.31, 0.53):
        alpha = alpha + to_si(0.3, "deg") * np.sin(2.0 * np.pi * (frequency * time + random.uniform()))
    return Mission(rate_hz=25, elevator_rad=np.zeros(alpha.size), wanted_rad=alpha, push_m_s2=np.concatenate(push))
