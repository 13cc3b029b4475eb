"""An aircraft ready to fly plans, whatever its fidelity."""

from __future__ import annotations

from collections.abc import Mapping
from types import TracebackType
from typing import Protocol, Self

from finback.flight.airborne import Airborne
from finback.flight.aircraft import Aircraft
from finback.flight.ending import Escape
from finback.flight.motion import Incomplete, Motion
from finback.flight.plan import FlightOptions, FlightPlan
from finback.flight.rig import Rig
from finback.records import Condition, FlightRecord, Schedule


class Vehicle(Protocol):
    """An aircraft in one fidelity; a context manager. It stays in the process that made it.

    What makes one (aircraft, condition, options) and what it flies and returns (plans, records) can be pickled.
    A flight leaves nothing behind: the same plan gives the same bits, whatever was flown before.
    """

    @property
    def provenance(self) -> Mapping[str, str]:
        """What is flown: aircraft, fidelity, what was replaced, versions."""

    def fly(self, plan: FlightPlan) -> FlightRecord:
        """Fly a plan and return what happened, without noise.

        Raises:
            InputError: the plan does not fit the fidelity or the step.
            RefusedError: the step is too long for this aircraft.
        """

    def escape(
        self,
        *,
        alpha_rad: float,
        q_rad_s: float,
        schedule: Schedule,
        duration_s: float,
        alpha_limits_rad: tuple[float, float],
    ) -> Escape:
        """Fly from a level start and tell only how it ended."""

    def derivatives(self, alpha_rad: float, q_rad_s: float, elevator_rad: float) -> tuple[float, float]:
        """Return (d alpha/dt in rad/s, dq/dt in rad/s²) on a level path at the reference flight; no time passes."""

    def motion(self, plan: FlightPlan) -> Motion | Incomplete:
        """Return the equations that a plan is flown by, for another integrator, or what remembers more than a state.

        Raises:
            InputError: the plan does not fit the fidelity.
        """

    def __enter__(self) -> Self:
        """Return itself."""

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove what lies in temporary folders."""


def make_vehicle(aircraft: Aircraft, condition: Condition, options: FlightOptions) -> Vehicle:
    """Return an aircraft that flies plans in the fidelity of the options.

    Raises:
        AircraftError: the aircraft or its derived copy does not load without a warning.
        RefusedError: the aircraft's own flight control cannot follow a schedule of the elevator.
    """
    if options.fidelity == "rig":
        return Rig(aircraft, condition, step_s=options.step_s)
    return Airborne(aircraft, condition, options)
