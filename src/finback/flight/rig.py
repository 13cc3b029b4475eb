"""The rig: alpha and q of an aircraft move; airspeed, density and the gravity term g/V of the reference flight do not.

On it  alpha_dot = q - L/(mV) + g/V  and  q_dot = M/Iyy,  with L and M of the aircraft's own tables: a force along the
wind cancels drag, a second one, m·g along +z of the wind axes, supplies g/V. The elevator is driven directly.
"""

from __future__ import annotations

import math
import tempfile
from contextlib import ExitStack
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Final, Self, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.errors import InputError, RefusedError
from finback.flight.air import CalmAir
from finback.flight.aircraft import Aircraft
from finback.flight.derivation import ELEVATOR
from finback.flight.ending import Escape, ending
from finback.flight.lead_in import STEPS, lead_in
from finback.flight.loading import AS_LOADED, Loading
from finback.flight.motion import Incomplete, Motion
from finback.flight.mounting import Mounting, Surroundings
from finback.flight.pilot import ON_GRID, commands_of
from finback.flight.plan import FlightPlan, check_alpha_limits, told, whole_steps
from finback.flight.power import EnginesOff
from finback.flight.recorder import Recorder
from finback.flight.start import LevelStart
from finback.flight.steps import Steps, Stop
from finback.records import Condition, FlightRecord, Outcome, Schedule
from finback.units import from_si, to_si

_AIRSPEED_HELD: Final = (
    1e-4  # m/s; beyond, a flight says so. Violent releases of the F-8 reach 5e-4 at 100 Hz, not 1e-4 at 200 Hz
)
_AIRSPEED_LOST: Final = 1e-4  # relative; a step near instability drifts by 1e-3
_SAMPLED: Final = (
    "aero/alpha-rad",
    "velocities/q-rad_sec",
    "attitude/theta-rad",
    "attitude/phi-rad",
    "velocities/vtrue-fps",
    "position/h-sl-ft",
    "accelerations/udot-ft_sec2",
    "accelerations/wdot-ft_sec2",
    "accelerations/qdot-rad_sec2",
)


def unfolded_pitch(theta_rad: FloatArray, phi_rad: FloatArray) -> FloatArray:
    """Return the pitch angle of a motion in the vertical plane, continuous, also through ±π/2.

    Euler angles fold it there and turn roll by half a turn.
    """
    return np.unwrap(np.where(np.abs(phi_rad) > math.pi / 2, math.pi - theta_rad, theta_rad))


@final
class Rig:
    """An aircraft on the rig; a context manager.

    The derived copy of the aircraft lies in a temporary folder, removed at exit.

    Args:
        aircraft: any JSBSim aircraft whose lift, drag and pitch read ``fcs/elevator-pos-rad``.
        condition: the reference flight that is held.
        step_s: integration step.

    Attributes:
        model: the XML file of the derived copy.
        provenance: what was flown, what the copy replaced, versions.

    Raises:
        AircraftError: the aircraft or its copy does not load without a warning.
    """

    def __init__(self, aircraft: Aircraft, condition: Condition, *, step_s: float) -> None:
        self.aircraft = aircraft
        self.condition = condition
        self.step_s = step_s
        self._airspeed = from_si(condition.airspeed_m_s, "ft_s")
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="finback-rig-")))
            surroundings = Surroundings(fidelity="rig", direct=True, step_s=step_s)
            self._mounting = Mounting(aircraft, condition, surroundings, folder)
            self.provenance = MappingProxyType(dict(self._mounting.provenance))
            self._use(AS_LOADED)
            self.model = self._simulator.path
            self._stack = stack.pop_all()

    def _use(self, loading: Loading) -> None:
        """Fly the aircraft so loaded from now on."""
        self._loading = loading
        self._simulator = simulator = self._mounting.simulator(loading)
        self._elevator = simulator.setter(ELEVATOR)
        self._ic_phi = simulator.setter("ic/phi-rad")
        self._ic_theta = simulator.setter("ic/theta-rad")
        self._ic_psi = simulator.setter("ic/psi-true-rad")
        self._ic_u = simulator.setter("ic/u-fps")
        self._ic_v = simulator.setter("ic/v-fps")
        self._ic_w = simulator.setter("ic/w-fps")
        self._ic_q = simulator.setter("ic/q-rad_sec")
        self._sampled = tuple(simulator.getter(name) for name in _SAMPLED)
        self._alpha, self._q = self._sampled[:2]
        self._u_dot, self._w_dot, self._q_dot = self._sampled[-3:]
        self._evaluate = simulator.evaluate
        self._steps = Steps(drive=self._elevator, run=simulator.run, alpha=self._alpha, q=self._q)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def derivatives(self, alpha_rad: float, q_rad_s: float, elevator_rad: float) -> tuple[float, float]:
        """Return (d alpha/dt in rad/s, dq/dt in rad/s²) of a state; no time passes, nothing is remembered.

        Raises:
            InputError: a number is not finite.
        """
        if not math.isfinite(alpha_rad + q_rad_s + elevator_rad):
            raise InputError(
                f"not a state that can be flown: alpha {from_si(alpha_rad, 'deg'):.6g} deg,"
                f" q {from_si(q_rad_s, 'deg_s'):.6g} deg/s, elevator {from_si(elevator_rad, 'deg'):.6g} deg"
            )
        if self._loading is not AS_LOADED:
            self._use(AS_LOADED)
        return self._rates(alpha_rad, q_rad_s, elevator_rad)

    def motion(self, plan: FlightPlan) -> Motion | Incomplete:
        """Return the equations that a plan is flown by: alpha and q.

        Raises:
            InputError: the plan asks for what the rig holds.
        """
        _check_plan(plan)
        if late := self._mounting.late:
            return Incomplete(reason=f"its aerodynamics read {', '.join(late)} a frame late")
        if plan.loading != self._loading:
            self._use(plan.loading)
        axes, look = self._mounting.tables(self._simulator)

        def rates(state: FloatArray, elevator_rad: float) -> FloatArray:
            return np.array(self._rates(float(state[0]), float(state[1]), elevator_rad))

        start = frozen_array([plan.alpha_rad, plan.q_rad_s])
        return Motion(start=start, alpha=0, q=1, rates=rates, axes=axes, look=look)

    def _rates(self, alpha_rad: float, q_rad_s: float, elevator_rad: float) -> tuple[float, float]:
        self._place(alpha_rad, q_rad_s, elevator_rad)
        self._evaluate()
        turn = math.cos(alpha_rad) * self._w_dot() - math.sin(alpha_rad) * self._u_dot()
        return turn / self._airspeed, self._q_dot()

    def fly(self, plan: FlightPlan) -> FlightRecord:
        """Fly a plan and return what happened, without noise.

        The record has a row at every sample until the end of the plan or, earlier, the last sample before alpha left
        its limits; its note says so if the airspeed drifted by more than 1e-4 m/s. At a jump of the elevator its column
        has the new value, while the accelerations of that row belong to the mean of both (what a multistep integrator
        must be given). Pitch angle is continuous, also through ±90°.

        Raises:
            InputError: the plan asks for what the rig holds, or does not fit the step, or a jump lies off it.
            RefusedError: the step is too long for this aircraft: its airspeed was not held.
        """
        _check_plan(plan)
        if plan.loading != self._loading:
            self._use(plan.loading)
        stride = whole_steps(plan.sample_interval_s, self.step_s, what=f"flight '{plan.name}': the sample interval")
        rows = math.floor(plan.duration_s / plan.sample_interval_s + ON_GRID)
        commands = commands_of(plan.schedule, rows * stride, self.step_s)
        self._start(plan.alpha_rad, plan.q_rad_s, commands[0])
        recorder = Recorder(self._sampled, ["1"] * len(_SAMPLED))
        recorder.take()
        stop, steps = self._steps.record(commands[1:], plan.alpha_limits_rad, recorder, stride=stride)
        outcome, note = Outcome.COMPLETED, f"flew its {steps * self.step_s:g} s"
        if stop is Stop.LIMITS:
            outcome, note = self._ended(steps * self.step_s, plan.alpha_limits_rad)
        elif stop is Stop.NOT_FINITE:
            outcome, note = Outcome.DIVERGED, f"accelerations were no longer finite at {steps * self.step_s:.4f} s"
        table = recorder.table()
        note += self._drift(plan.name, table[:, _SAMPLED.index("velocities/vtrue-fps")])
        time = np.arange(len(table), dtype=np.float64) * (stride * self.step_s)
        columns = {"time_s": time, "elevator_rad": plan.schedule.value(time), **self._columns(table)}
        return FlightRecord(
            name=plan.name,
            columns=columns,
            outcome=outcome,
            note=note,
            condition=self.condition,
            schedule=plan.schedule,
            hold=plan.hold,
            provenance={**self.provenance, **told(plan)},
        )

    def escape(
        self,
        *,
        alpha_rad: float,
        q_rad_s: float,
        schedule: Schedule,
        duration_s: float,
        alpha_limits_rad: tuple[float, float],
    ) -> Escape:
        """Fly without recording and return when alpha left its limits, if it did; the flight ends there.

        Raises:
            InputError: a number is not finite, the limits are out of order, or a jump lies off the step.
        """
        check_alpha_limits(alpha_limits_rad)
        if not math.isfinite(alpha_rad + q_rad_s + duration_s):
            raise InputError(
                f"not a flight: alpha {from_si(alpha_rad, 'deg'):.6g} deg, q {from_si(q_rad_s, 'deg_s'):.6g} deg/s,"
                f" {duration_s:.6g} s"
            )
        if self._loading is not AS_LOADED:
            self._use(AS_LOADED)
        commands = commands_of(schedule, math.floor(duration_s / self.step_s + ON_GRID), self.step_s)
        self._start(alpha_rad, q_rad_s, commands[0])
        ended = self._steps.advance(commands[1:], alpha_limits_rad)
        time = (ended or len(commands) - 1) * self.step_s
        outcome = self._ended(time, alpha_limits_rad)[0] if ended else Outcome.COMPLETED
        return Escape(outcome=outcome, time_s=time, alpha_rad=self._alpha())

    def _place(self, alpha_rad: float, q_rad_s: float, elevator_rad: float, airspeed: float = 1.0) -> None:
        # Level and northward JSBSim's turn of the velocity is exact, so nothing of earlier flights is left, not a bit.
        self._ic_phi(0.0)
        self._ic_psi(0.0)
        self._ic_theta(0.0)
        self._ic_u(airspeed * self._airspeed * math.cos(alpha_rad))
        self._ic_v(0.0)
        self._ic_w(airspeed * self._airspeed * math.sin(alpha_rad))
        self._ic_q(q_rad_s)
        self._elevator(elevator_rad)

    def _start(self, alpha_rad: float, q_rad_s: float, elevator_rad: float) -> None:
        """Begin a flight on a level path, pitch angle equal to alpha, with the past of its motion, if that has one."""
        wanted = np.array([alpha_rad, q_rad_s, alpha_rad, 1.0])  # alpha, q, pitch angle, share of the airspeed held

        def rates(state: FloatArray) -> FloatArray:
            alpha, q = state[:2].tolist()
            return np.array([*self._rates(alpha, q, elevator_rad), q, 0.0])

        def flown(state: FloatArray) -> FloatArray:
            self._begin(state, elevator_rad)
            for _ in range(STEPS):
                self._elevator(elevator_rad)
                self._simulator.run()
            alpha, q, theta, phi, airspeed = (get() for get in self._sampled[:5])
            theta = theta if abs(phi) <= math.pi / 2 else math.pi - theta
            return np.array([alpha, q, theta, airspeed / self._airspeed])

        if self._mounting.late or not lead_in(wanted, rates, flown, step_s=self.step_s):
            self._begin(wanted, elevator_rad)

    def _begin(self, state: FloatArray, elevator_rad: float) -> None:
        alpha, q, theta, airspeed = state.tolist()
        self._simulator.reset()
        self._simulator.write(self._mounting.surfaces)
        self._place(alpha, q, elevator_rad, airspeed)
        self._ic_theta(theta)
        self._simulator.start()

    def _ended(self, time_s: float, alpha_limits_rad: tuple[float, float]) -> tuple[Outcome, str]:
        return ending(self._simulator, self._alpha(), self._q(), time_s, alpha_limits_rad)

    def _drift(self, name: str, airspeed_ft_s: FloatArray) -> str:
        """Return what a flight has to say of an airspeed that was not held; nothing if it was."""
        drift = float(np.abs(airspeed_ft_s - self._airspeed).max())
        if not drift <= _AIRSPEED_LOST * self._airspeed:
            raise RefusedError(
                f"flight '{name}': the rig's airspeed drifted by {drift / self._airspeed:.1e} of itself; the step of"
                f" {self.step_s:g} s is too long for so fast a motion",
                hint="choose a shorter step",
            )
        if to_si(drift, "ft_s") <= _AIRSPEED_HELD:
            return ""
        return f"; its airspeed drifted by {to_si(drift, 'ft_s'):.1e} m/s, a shorter step would hold it"

    def _columns(self, table: FloatArray) -> dict[str, FloatArray]:
        alpha, q, theta, phi, airspeed, altitude, u_dot, w_dot, q_dot = table.T
        return {
            "alpha_rad": alpha,
            "q_rad_s": q,
            "theta_rad": unfolded_pitch(theta, phi),
            "airspeed_m_s": to_si(airspeed, "ft_s"),
            "altitude_m": to_si(altitude, "ft"),
            "alpha_dot_rad_s": (np.cos(alpha) * w_dot - np.sin(alpha) * u_dot) / airspeed,
            "q_dot_rad_s2": q_dot,
        }


def _check_plan(plan: FlightPlan) -> None:
    """Refuse what the rig has not: it holds airspeed and altitude, and has no engines and no weather."""
    for kind, value, name in (
        (LevelStart, plan.start, "start"),
        (EnginesOff, plan.power, "power"),
        (CalmAir, plan.air, "air"),
    ):
        if not isinstance(value, kind):
            raise InputError(
                f"flight '{plan.name}': the rig has no {name} of kind {type(value).__name__}",
                hint="choose fidelity 'symmetric' or 'free'",
            )
