"""An aircraft in the air: in its plane of symmetry (``symmetric``), or in all six degrees of freedom (``free``).

``symmetric``: sphere at rest, gravity and air of the standard atmosphere, surfaces driven directly, wings level.
``free``: JSBSim's turning Earth, the whole of the aerodynamics, and either the aircraft's own flight control and
actuators or surfaces driven directly. Engines, thrust and loading are the plan's; no fuel is burnt.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Final, Self, final

import numpy as np

from finback.arrays import FloatArray
from finback.errors import InputError
from finback.flight.air import CalmAir, DrydenAir
from finback.flight.aircraft import Aircraft
from finback.flight.coordinates import InPlane, InSpace
from finback.flight.derivation import AILERON, ELEVATOR, RUDDER
from finback.flight.derived_model import THRUST
from finback.flight.ending import Escape, ending
from finback.flight.engines import Engines
from finback.flight.felt import felt
from finback.flight.lead_in import STEPS, lead_in
from finback.flight.loading import AS_LOADED, Loading
from finback.flight.motion import Incomplete, Motion
from finback.flight.mounting import Mounting, Surroundings
from finback.flight.pilot import ON_GRID, Stick, commands_of, direct_stick, flight_control_stick
from finback.flight.plan import Drive, FlightOptions, FlightPlan, check_alpha_limits, told, whole_steps
from finback.flight.power import EnginesOff, FixedThrust, Power
from finback.flight.recorder import Recorder
from finback.flight.rig import unfolded_pitch
from finback.flight.start import FreeStart, LevelStart, SymmetricStart
from finback.flight.state import AIRSPEED, ALTITUDE, ANGLES_AND_RATES, STATE_NAMES, FlightState, StateNodes
from finback.flight.steps import Steps, Stop
from finback.flight.turbulence import dryden_gusts
from finback.records import Condition, FlightRecord, Hold, Outcome, Schedule
from finback.units import from_si, to_si

_SAMPLED: Final = (
    *ANGLES_AND_RATES,
    AIRSPEED,
    ALTITUDE,
    ("elevator_rad", ELEVATOR, "rad"),
    ("aileron_rad", AILERON, "rad"),
    ("rudder_rad", RUDDER, "rad"),
    ("q_dot_rad_s2", "accelerations/qdot-rad_sec2", "rad_s2"),
)
_ACCELERATIONS: Final = (
    "velocities/u-fps",
    "velocities/w-fps",
    "accelerations/udot-ft_sec2",
    "accelerations/wdot-ft_sec2",
)
_ALPHA, _Q, _THETA, _PHI, _ALTITUDE, _ELEVATOR = (
    [name for name, _, _ in _SAMPLED].index(name)
    for name in ("alpha_rad", "q_rad_s", "theta_rad", "phi_rad", "altitude_m", "elevator_rad")
)
_WINDS: Final = "simulation/models/FGWinds/enabled"
_WIND: Final = tuple(f"atmosphere/wind-{way}-fps" for way in ("north", "east", "down"))
_SIDEWAYS: Final = ("beta_rad", "phi_rad", "psi_rad", "p_rad_s", "r_rad_s", "latitude_rad")


@final
class Airborne:
    """An aircraft in ``symmetric`` or ``free`` flight; a context manager.

    The derived copy of the aircraft lies in a temporary folder, removed at exit.

    Args:
        aircraft: any JSBSim aircraft whose lift, drag and pitch read ``fcs/elevator-pos-rad``.
        condition: the reference flight: where level starts begin; its density and gravity are those of the rig only.
        options: fidelity, step, drive, thrust and properties.

    Attributes:
        symmetric: it flies in its plane of symmetry.
        provenance: what was flown, what the copy replaced, versions.

    Raises:
        AircraftError: the aircraft or its copy does not load without a warning.
        RefusedError: the aircraft's own flight control does not bring the elevator where a schedule wants it.
    """

    def __init__(self, aircraft: Aircraft, condition: Condition, options: FlightOptions) -> None:
        self.aircraft = aircraft
        self.condition = condition
        self.step_s = options.step_s
        self._options = options
        self.symmetric = options.fidelity == "symmetric"
        self._direct = self.symmetric or options.drive is Drive.DIRECT
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="finback-flight-")))
            surroundings = Surroundings(fidelity=options.fidelity, direct=self._direct, step_s=options.step_s)
            self._mounting = Mounting(aircraft, condition, surroundings, folder)
            self._engines = Engines(aircraft, condition, direct=self._direct)
            self._use(AS_LOADED)
            self.model = self._simulator.path
            self._stick = self._find_stick()
            settings = ", ".join(f"{name} = {value:.9g}" for name, value in options.properties)
            self.provenance = MappingProxyType(
                {**self._mounting.provenance, "drive": self._stick.drive, "properties": settings or "none"}
            )
            self._stack = stack.pop_all()

    def _use(self, loading: Loading) -> None:
        """Fly the aircraft so loaded from now on."""
        self._loading = loading
        self._simulator = simulator = self._mounting.simulator(loading)
        self._nodes = StateNodes(simulator)
        self._elevator = simulator.setter(ELEVATOR if self._direct else "fcs/elevator-cmd-norm")
        self._thrust = simulator.setter(THRUST)
        self._wind = tuple(simulator.setter(name) for name in _WIND)
        self._sampled = tuple(simulator.getter(name) for _, name, _ in _SAMPLED)
        self._accelerations = tuple(simulator.getter(name) for name in _ACCELERATIONS)
        self._alpha, self._q = self._sampled[_ALPHA], self._sampled[_Q]
        self._steps = Steps(drive=self._elevator, run=simulator.run, alpha=self._alpha, q=self._q)
        self._reset()

    def _find_stick(self) -> Stick:
        if self._direct:
            return direct_stick()
        state = self._level(0.0, 0.0)

        def moved(command: float) -> float:
            self._begin(state, command, self._options.power)
            return self._sampled[_ELEVATOR]()

        return flight_control_stick(moved, place=str(self.aircraft.path))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    @property
    def mass_kg(self) -> float:
        """Mass as loaded."""
        return float(self.provenance["mass_kg"])

    # right-hand sides

    def derivatives(self, alpha_rad: float, q_rad_s: float, elevator_rad: float) -> tuple[float, float]:
        """Return (d alpha/dt in rad/s, dq/dt in rad/s²) in level flight at the reference flight; no time passes.

        Raises:
            InputError: a number is not finite.
        """
        rates = self.rates(self._level(alpha_rad, q_rad_s), elevator_rad, self._options.power)
        return rates[1], rates[4]

    def rates(self, state: FlightState, elevator_rad: float, power: Power) -> tuple[float, ...]:
        """Return the rates of ``STATE_NAMES`` in a state, as loaded, in still air; no time passes.

        Surfaces stand where they are asked to be, actuators have come to rest, turbines turn steadily.

        Raises:
            InputError: a number is not finite.
        """
        numbers = (*(getattr(state, name) for name in STATE_NAMES), elevator_rad, state.altitude_m)
        if not math.isfinite(sum(numbers)):
            raise InputError(f"not a state that can be flown: {state}, elevator {from_si(elevator_rad, 'deg'):.6g} deg")
        if self._loading is not AS_LOADED:
            self._use(AS_LOADED)
        return self._rates(state, elevator_rad, power)

    def motion(self, plan: FlightPlan) -> Motion | Incomplete:
        """Return the equations that a plan is flown by, if a state of flight is all that they remember.

        Raises:
            InputError: the plan does not fit the fidelity.
        """
        first = self._first_state(plan)
        if reason := self._memory(plan.power):
            return Incomplete(reason=reason)
        if not isinstance(plan.air, CalmAir):
            return Incomplete(reason="turbulence is drawn step by step")
        if plan.loading != self._loading:
            self._use(plan.loading)
        axes, look = self._mounting.tables(self._simulator)
        coordinates = self._coordinates

        def rates(state: FloatArray, elevator_rad: float) -> FloatArray:
            return self._array_rates(state, elevator_rad, plan.power)

        return Motion(
            start=coordinates.of(first), alpha=coordinates.alpha, q=coordinates.q, rates=rates, axes=axes, look=look
        )

    @property
    def _coordinates(self) -> type[InPlane | InSpace]:
        return InPlane if self.symmetric else InSpace

    def _array_rates(self, state: FloatArray, elevator_rad: float, power: Power) -> FloatArray:
        flying = self._coordinates.state(state)
        return self._coordinates.rates(state, self._rates(flying, elevator_rad, power), flying, self._nodes)

    def _memory(self, power: Power) -> str:
        """Return what a flight in calm air remembers beside its state, in words; empty if nothing."""
        if not self._direct:
            return "the aircraft's own flight control and actuators have a state of their own"
        if not isinstance(power, (EnginesOff, FixedThrust)):
            return "engines under a throttle have a state of their own"
        if late := self._mounting.late:
            return f"its aerodynamics read {', '.join(late)} a frame late"
        return ""

    def _rates(self, state: FlightState, elevator_rad: float, power: Power) -> tuple[float, ...]:
        if not self._direct:  # a flight control remembers the state before
            self._reset()
            self._drive_by(power)
        elif power is not self._power and power != self._power:
            self._switch(power)
        self._nodes.place(state)
        self._elevator(self._stick.command(elevator_rad))
        self._simulator.evaluate_steadily()
        return self._nodes.rates(state)

    # flights

    def fly(self, plan: FlightPlan) -> FlightRecord:
        """Fly a plan and return what happened, without noise.

        The record has a row at every sample until the end of the plan or, earlier, the last sample before alpha left
        its limits or the aircraft reached the ground. In ``symmetric`` the pitch angle is continuous, also through
        ±90°, and roll is 0 there. In turbulence alpha, beta and airspeed are those to the moving air, from the first
        step on, and there is no rate of alpha.

        Raises:
            InputError: the plan does not fit the fidelity or the step.
        """
        if plan.loading != self._loading:
            self._use(plan.loading)
        stride = whole_steps(plan.sample_interval_s, self.step_s, what=f"flight '{plan.name}': the sample interval")
        rows = math.floor(plan.duration_s / plan.sample_interval_s + ON_GRID)
        commands = [self._stick.command(value) for value in commands_of(plan.schedule, rows * stride, self.step_s)]
        first_state = self._first_state(plan)
        self._start(first_state, commands[0], plan.power)
        gusts = self._gusts(plan, first_state, rows * stride)
        recorder = Recorder((*self._sampled, *self._accelerations), ["1"] * (len(_SAMPLED) + len(_ACCELERATIONS)))
        recorder.take()
        facts = told(plan) | felt(self._simulator)
        steps = self._steps_through(gusts[1:]) if gusts else self._steps
        stop, flown = steps.record(commands[1:], plan.alpha_limits_rad, recorder, stride=stride, altitude=_ALTITUDE)
        outcome, note = self._ending(stop, flown * self.step_s, plan.alpha_limits_rad)
        if gusts:  # JSBSim keeps the last wind, and what a start leaves in it; a new simulator has none
            self._mounting.forget(plan.loading)
            self._use(plan.loading)
        return self._record(plan, recorder.table(), outcome, note, facts)

    def escape(
        self,
        *,
        alpha_rad: float,
        q_rad_s: float,
        schedule: Schedule,
        duration_s: float,
        alpha_limits_rad: tuple[float, float],
    ) -> Escape:
        """Fly from a level start until alpha leaves its limits or the time is over; nothing is recorded.

        Raises:
            InputError: a number is not finite, or the elevator jumps off the step.
        """
        check_alpha_limits(alpha_limits_rad)
        if not math.isfinite(alpha_rad + q_rad_s + duration_s):
            raise InputError(f"not a state that can be flown: {self._level(alpha_rad, q_rad_s)}")
        if self._loading is not AS_LOADED:
            self._use(AS_LOADED)
        steps = math.floor(duration_s / self.step_s + ON_GRID)
        commands = [self._stick.command(value) for value in commands_of(schedule, steps, self.step_s)]
        self._start(self._level(alpha_rad, q_rad_s), commands[0], self._options.power)
        ended = self._steps.advance(commands[1:], alpha_limits_rad)
        time = (ended or steps) * self.step_s
        outcome = self._ended(time, alpha_limits_rad)[0] if ended else Outcome.COMPLETED
        return Escape(outcome=outcome, time_s=time, alpha_rad=self._alpha())

    def _level(self, alpha_rad: float, q_rad_s: float) -> FlightState:
        return FlightState(
            airspeed_m_s=self.condition.airspeed_m_s,
            alpha_rad=alpha_rad,
            q_rad_s=q_rad_s,
            theta_rad=alpha_rad,
            altitude_m=self.condition.altitude_m,
        )

    def _first_state(self, plan: FlightPlan) -> FlightState:
        start = plan.start
        if self.symmetric and (isinstance(start, FreeStart) or not isinstance(plan.air, CalmAir)):
            raise InputError(
                f"flight '{plan.name}': symmetric flight has no {type(start).__name__} and no turbulence",
                hint="choose fidelity 'free'",
            )
        if isinstance(start, LevelStart):
            return self._level(plan.alpha_rad, plan.q_rad_s)
        sideways = {} if isinstance(start, SymmetricStart) else {name: getattr(start, name) for name in _SIDEWAYS}
        return FlightState(
            airspeed_m_s=start.airspeed_m_s,
            alpha_rad=plan.alpha_rad,
            q_rad_s=plan.q_rad_s,
            theta_rad=start.theta_rad,
            altitude_m=start.altitude_m,
            **sideways,
        )

    def _reset(self) -> None:
        self._power: Power | None = None
        self._simulator.reset()
        self._simulator.write({**self._mounting.surfaces, **dict(self._options.properties)})

    def _switch(self, power: Power) -> None:
        """Change the power between two evaluations; a fixed thrust is one number, engines want a reset."""
        if isinstance(power, FixedThrust) and isinstance(self._power, FixedThrust):
            self._thrust(from_si(power.thrust_n, "lbf"))
            self._power = power
            return
        self._reset()
        self._drive_by(power)

    def _drive_by(self, power: Power) -> None:
        self._engines.use(self._simulator, power)
        self._power = power

    def _start(self, state: FlightState, command: float, power: Power) -> None:
        """Begin a flight in calm air, with the past of its motion if a state is all that it remembers."""
        coordinates = self._coordinates
        wanted = coordinates.of(state)

        def rates(array: FloatArray) -> FloatArray:
            return self._array_rates(array, command, power)

        def flown(array: FloatArray) -> FloatArray:
            self._begin(coordinates.state(array), command, power)
            for _ in range(STEPS):
                self._elevator(command)
                self._simulator.run()
            return coordinates.near(coordinates.of(self._nodes.state()), wanted)

        if self._memory(power) or not lead_in(wanted, rates, flown, step_s=self.step_s):
            self._begin(state, command, power)

    def _begin(self, state: FlightState, command: float, power: Power) -> None:
        self._reset()
        self._nodes.place(state)
        self._elevator(command)
        self._drive_by(power)
        self._simulator.start_steadily()

    def _gusts(self, plan: FlightPlan, state: FlightState, steps: int) -> list[tuple[float, ...]]:
        """Return the wind of each step, north, east and down in ft/s, if any; gusts follow the first heading."""
        if not isinstance(plan.air, DrydenAir):
            return []
        self._simulator.write({_WINDS: 1.0})
        found = dryden_gusts(plan.air, airspeed_m_s=state.airspeed_m_s, step_s=self.step_s, steps=steps)
        along, across, down = from_si(found, "ft_s").T
        north = along * math.cos(state.psi_rad) - across * math.sin(state.psi_rad)
        east = along * math.sin(state.psi_rad) + across * math.cos(state.psi_rad)
        return list(zip(north.tolist(), east.tolist(), down.tolist(), strict=True))

    def _steps_through(self, gusts: Sequence[tuple[float, ...]]) -> Steps:
        """Return steps that write a wind each before they drive the elevator."""
        winds, drive, puts = iter(gusts), self._elevator, self._wind

        def drive_in_wind(command: float) -> None:
            for put, wind in zip(puts, next(winds), strict=True):
                put(wind)
            drive(command)

        return replace(self._steps, drive=drive_in_wind)

    def _ending(self, stop: Stop, time_s: float, alpha_limits_rad: tuple[float, float]) -> tuple[Outcome, str]:
        match stop:
            case Stop.LIMITS:
                return self._ended(time_s, alpha_limits_rad)
            case Stop.NOT_FINITE:
                return Outcome.DIVERGED, f"the state was no longer finite at {time_s:.4f} s"
            case Stop.GROUND:
                return Outcome.DEPARTED, f"reached the ground before {time_s:.4f} s"
            case Stop.COMMANDS:
                return Outcome.COMPLETED, f"flew its {time_s:g} s"

    def _ended(self, time_s: float, alpha_limits_rad: tuple[float, float]) -> tuple[Outcome, str]:
        return ending(self._simulator, self._alpha(), self._q(), time_s, alpha_limits_rad)

    def _record(
        self, plan: FlightPlan, table: FloatArray, outcome: Outcome, note: str, facts: dict[str, str]
    ) -> FlightRecord:
        stride = whole_steps(plan.sample_interval_s, self.step_s, what="the sample interval")
        time = np.arange(len(table), dtype=np.float64) * (stride * self.step_s)
        columns = {"time_s": time}
        for index, (name, _, unit) in enumerate(_SAMPLED):
            columns[name] = to_si(table[:, index], unit)
        u, w, u_dot, w_dot = table[:, len(_SAMPLED) :].T
        if isinstance(plan.air, CalmAir):  # gusts have no rate
            columns["alpha_dot_rad_s"] = (u * w_dot - w * u_dot) / (u * u + w * w)
        if self.symmetric:
            columns["theta_rad"] = unfolded_pitch(table[:, _THETA], table[:, _PHI])
            turned = np.where(np.abs(table[:, _PHI]) > math.pi / 2, math.pi, 0.0)
            columns["phi_rad"] = np.abs(table[:, _PHI]) - turned
        if self._direct:
            columns["elevator_rad"] = plan.schedule.value(time)
        return FlightRecord(
            name=plan.name,
            columns=columns,
            outcome=outcome,
            note=note,
            condition=self.condition,
            schedule=plan.schedule,
            hold=plan.hold if self._direct else Hold.ACTUATOR,
            provenance={**self.provenance, **facts},
        )
