"""Time histories of a Liénard system under a moving elevator, its rate included."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.flow import horner
from finback.dynamics.lienard import LienardSystem
from finback.errors import InputError

_RELATIVE: Final = 3e-14  # the least that scipy's DOP853 accepts; states agree with 30-digit ones to 1e-12
_SMALL: Final = 1e-9  # of the state's size: below it the error is absolute
_FAR: Final = 1e6  # rad, rad/s: beyond it a response has blown up


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ElevatorSchedule:
    """The elevator over time: straight between corners, held before the first and after the last.

    Attributes:
        time_s: times of the corners, not falling, shape (n,); two equal times are a step.
        elevator_rad: the elevator there, shape (n,).
    """

    time_s: FloatArray
    elevator_rad: FloatArray

    def __post_init__(self) -> None:
        """Freeze and check the arrays."""
        for name in ("time_s", "elevator_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        if self.time_s.ndim != 1 or not self.time_s.size or self.time_s.shape != self.elevator_rad.shape:
            raise InputError(
                f"an elevator schedule has times and elevators of one length, got shapes {self.time_s.shape} and "
                f"{self.elevator_rad.shape}"
            )
        if not (np.isfinite(self.time_s).all() and np.isfinite(self.elevator_rad).all()):
            raise InputError("an elevator schedule holds numbers that are not finite")
        if (np.diff(self.time_s) < 0.0).any():
            raise InputError("the times of an elevator schedule fall", hint="order its corners by time")

    @classmethod
    def held(cls, elevator_rad: float) -> ElevatorSchedule:
        """Return an elevator that never moves."""
        return cls(time_s=np.zeros(1), elevator_rad=np.array([elevator_rad]))

    @classmethod
    def stepped(cls, time_s: float, *, before_rad: float, after_rad: float) -> ElevatorSchedule:
        """Return an elevator that moves once, at once."""
        return cls(time_s=np.array([time_s, time_s]), elevator_rad=np.array([before_rad, after_rad]))

    def before(self, time_s: float) -> float:
        """Return the elevator just before a time."""
        later = int(np.searchsorted(self.time_s, time_s, side="left"))
        return self._between(later, time_s)

    def after(self, time_s: float) -> float:
        """Return the elevator just after a time."""
        later = int(np.searchsorted(self.time_s, time_s, side="right"))
        return self._between(later, time_s)

    def _between(self, later: int, time_s: float) -> float:
        """Return the elevator on the stretch that ends at a corner."""
        if later == 0:
            return float(self.elevator_rad[0])
        if later == self.time_s.size:
            return float(self.elevator_rad[-1])
        (start, end), (low, high) = self.time_s[later - 1 : later + 1], self.elevator_rad[later - 1 : later + 1]
        return float(low + (high - low) * ((time_s - start) / (end - start)))


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """A time history; arrays of equal length n.

    At a step of the elevator the values are those just after it.

    Attributes:
        time_s: the times asked for.
        elevator_rad: the elevator.
        alpha_rad: alpha; nan from where the solution has left for infinity, like the next two.
        alpha_dot_rad_s: dα/dt.
        q_rad_s: pitch rate.
    """

    time_s: FloatArray
    elevator_rad: FloatArray
    alpha_rad: FloatArray
    alpha_dot_rad_s: FloatArray
    q_rad_s: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        for name in ("time_s", "elevator_rad", "alpha_rad", "alpha_dot_rad_s", "q_rad_s"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


def respond(
    system: LienardSystem,
    schedule: ElevatorSchedule,
    *,
    time_s: ArrayLike,
    alpha_rad: float,
    alpha_dot_rad_s: float,
) -> Response:
    """Integrate x'' = f(x) x' + g(x) + c₁ δ + c₂ δ' (Shi & Fan 2013, Eq. 10-12 and 36).

    A step of δ by D makes x' jump by c₂ D, with x and q continuous; a ramp adds the constant c₂ δ'. Both are exact.
    Between them the explicit Runge-Kutta method of order 8 (Dormand & Prince; Hairer, Nørsett & Wanner 1993) is
    used to about rounding.

    Args:
        system: the system.
        schedule: the elevator.
        time_s: times at which the state is wanted, not falling, shape (n,).
        alpha_rad: alpha just before the first of them.
        alpha_dot_rad_s: dα/dt just before the first of them, thus before a step that falls on it.
    """
    times = np.asarray(time_s, dtype=np.float64)
    if times.ndim != 1 or not times.size or not np.isfinite(times).all() or (np.diff(times) < 0.0).any():
        raise InputError("the times of a response are to be finite and not falling, at least one")
    if not (math.isfinite(alpha_rad) and math.isfinite(alpha_dot_rad_s)):
        raise InputError(f"a response cannot begin at alpha {alpha_rad}, dα/dt {alpha_dot_rad_s}")
    states = np.full((times.size, 2), np.nan)
    state = np.array([alpha_rad, alpha_dot_rad_s])
    for start, end in _stretches(schedule, times):
        state[1] += system.elevator_rate_gain * (schedule.after(start) - schedule.before(start))
        state = _stretch(system, schedule, (start, end), state, (times, states))
        if not np.isfinite(state).all():
            break
    elevator = np.array([schedule.after(time) for time in times.tolist()])
    return Response(
        time_s=times,
        elevator_rad=elevator,
        alpha_rad=states[:, 0],
        alpha_dot_rad_s=states[:, 1],
        q_rad_s=system.pitch_rate_at(states[:, 0], states[:, 1], elevator),
    )


def _stretches(schedule: ElevatorSchedule, times: FloatArray) -> Iterator[tuple[float, float]]:
    """Yield the stretches between corners within the times asked for; the last is a point: what lies at its end."""
    first, last = float(times[0]), float(times[-1])
    corners = sorted({first, last, *(t for t in schedule.time_s.tolist() if first < t < last)})
    yield from pairwise(corners)
    yield last, last


def _stretch(
    system: LienardSystem,
    schedule: ElevatorSchedule,
    ends: tuple[float, float],
    state: FloatArray,
    samples: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Fill in the samples from the start of a stretch to before its end; return the state at its end."""
    start, end = ends
    times, states = samples
    mine = (times >= start) & (times < end) if start < end else times == start
    if start == end:
        states[mine] = state
        return state
    low, high = schedule.after(start), schedule.before(end)
    rate = (high - low) / (end - start)
    damping, force = system.damping.ascending.tolist(), system.force.ascending.tolist()
    gain, constant = system.elevator_gain, system.elevator_rate_gain * rate

    def field(time: float, now: FloatArray) -> tuple[float, float]:
        x, y = now.tolist()
        push = gain * (low + rate * (time - start)) + constant
        return y, horner(damping, x) * y + horner(force, x) + push

    def blown(_: float, now: FloatArray) -> float:
        return _FAR - float(np.abs(now).max())

    blown.terminal = True  # type: ignore[attr-defined]  # scipy's way to end an integration
    wanted = np.append(times[mine], end)
    with np.errstate(over="ignore", invalid="ignore"):  # a trial step may end beyond everything
        solved = solve_ivp(
            field,
            ends,
            state,
            method="DOP853",
            t_eval=wanted,
            events=blown,
            rtol=_RELATIVE,
            atol=_RELATIVE * _SMALL,
        )
    reached = solved.y.T[: wanted.size]
    places = np.flatnonzero(mine)[: len(reached)]
    states[places] = reached[: places.size]
    return np.asarray(reached[-1]) if len(reached) == wanted.size else np.full(2, np.nan)
