"""Which of a study's maneuvers to fly for a model: candidates flown by the model itself, bounds, a choice."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Final, final

import numpy as np

from finback.arrays import FloatArray, frozen_array
from finback.dynamics.model import PolynomialModel
from finback.errors import InputError, RefusedError
from finback.flight.excitation import Maneuver
from finback.flight.plan import FlightPlan
from finback.flight.sweep import plan_flights
from finback.identification.design.choice import Choice, bound, d_optimal
from finback.identification.design.information import Information, PlannedFlight, information
from finback.store import read_model_file
from finback.study import Study, read_study
from finback.study.candidates import candidates
from finback.units import from_si, quantity_of, unit_of

_WRITTEN: Final = {"rad": "deg", "rad_s": "deg_s", "1_s": "hz"}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Flights chosen from a study, and what they promise.

    Attributes:
        model: for which they were chosen.
        maneuvers: name of each candidate -> what it is.
        choice: the flights.
        all_errors: standard errors if every candidate were flown, shape (p,), in SI; the best that can be had.
        left_out: candidates that the model does not fly, each with its reason.
        proposed: how many candidates were proposed; 0 if they are the study's own.
    """

    model: PolynomialModel
    maneuvers: Mapping[str, Maneuver]
    choice: Choice
    all_errors: FloatArray
    left_out: tuple[str, ...]
    proposed: int


def design(
    study_file: Path, model_file: Path, *, count: int, repeated: int = 1, proposed_s: float | None = None
) -> Design:
    """Choose maneuvers of a study's sweep, or of those that suit the model.

    Args:
        study_file: gives candidates, limits, samples and noise.
        model_file: the model that is wanted, as well as it is known before the flights.
        count: how many flights there are to be.
        repeated: how often one may be flown.
        proposed_s: duration of flights that are proposed over the study's elevators (``candidates``) and stand
            instead of its sweep; none are if it is not given.

    Raises:
        InputError: a file has faults, the sensors have no noise, or there are too few candidates.
        RefusedError: the candidates cannot determine every coefficient.
    """
    study, model = read_study(study_file), _model(model_file)
    noise = (study.sensors.alpha_noise_rad, study.sensors.q_noise_rad_s)
    if proposed_s is not None:
        reach = study.analysis.elevator_range_rad
        maneuvers = candidates(model, study.flight, elevator_range_rad=reach, duration_s=proposed_s)
        study = replace(study, maneuvers=maneuvers)
    named, left_out = _planned(study, model)
    told: list[Information] = []
    for plan, _ in named.values():
        flight = _flight(plan)
        try:
            found = information(model, flight, noise=noise)
        except RefusedError as error:
            left_out.append(error.message)
            continue
        low, high = study.flight.alpha_limits_rad
        if low < found.states[:, 0].min() and found.states[:, 0].max() < high:
            told.append(found)
        else:
            left_out.append(f"flight '{plan.name}': alpha would leave its limits")
    if len(told) * repeated < count:
        raise InputError(
            f"{count} flights cannot be chosen from {len(told)} candidates"
            + (f", because: {'; '.join(left_out)}" if left_out else ""),
            hint="add maneuvers to [[sweep]]: lists of trims and amplitudes make one candidate for each combination",
        )
    return Design(
        model=model,
        maneuvers={name: maneuver for name, (_, maneuver) in named.items()},
        choice=d_optimal(told, count=count, repeated=repeated),
        all_errors=frozen_array(np.sqrt(np.diag(bound(told)))),
        left_out=tuple(left_out),
        proposed=0 if proposed_s is None else len(study.maneuvers),
    )


def as_toml(maneuvers: Sequence[Maneuver]) -> str:
    """Write maneuvers as a study's sweep, each as often as it is flown."""
    tables = []
    for maneuver in maneuvers:
        lines = [f"{name} = {value}" for name, value in numbers(maneuver).items()]
        tables.append("\n".join([f'[[sweep]]\nkind = "{maneuver.kind}"', *lines]))
    return "\n\n".join(tables) + "\n"


def as_study(study_file: Path, maneuvers: Sequence[Maneuver]) -> str:
    """Return the text of a study with these maneuvers in the place of its sweep; everything else stays as it stands.

    Raises:
        InputError: the text is written so that its sweep cannot be told from the rest.
    """
    text = study_file.read_text(encoding="utf-8")
    kept: list[str] = []
    place, inside = -1, False
    for line in text.splitlines(keepends=True):
        if line.lstrip().startswith("["):
            inside = line.split("#")[0].replace(" ", "").strip() == "[[sweep]]"
            place = len(kept) if inside and place < 0 else place
        if not inside:
            kept.append(line)
    place = len(kept) if place < 0 else place
    made = "".join([*kept[:place], as_toml(maneuvers), "\n", *kept[place:]])
    old = tomllib.loads(text)
    try:
        new = tomllib.loads(made)
    except tomllib.TOMLDecodeError:
        new = {}
    if {**old, "sweep": ()} != {**new, "sweep": ()} or len(new["sweep"]) != len(maneuvers):
        raise InputError(
            f"the sweep of {study_file} cannot be replaced in its text", hint="use --output, and put it there by hand"
        )
    return made


def numbers(maneuver: Maneuver) -> dict[str, float]:
    """Return every number of a maneuver by the name that a study has for it, in its unit, to twelve digits."""
    found = {}
    for part in fields(maneuver):
        unit = unit_of(part.name)
        written = _WRITTEN.get(unit, unit)
        value = from_si(getattr(maneuver, part.name), written)
        found[f"{quantity_of(part.name)}_{written}"] = float(f"{value:.12g}")
    return found


def _model(path: Path) -> PolynomialModel:
    file = read_model_file(path)
    return file.model().held(**file.held)


def _planned(study: Study, model: PolynomialModel) -> tuple[dict[str, tuple[FlightPlan, Maneuver]], list[str]]:
    """Plan every maneuver from the model's own trims; those without a trim are left out."""

    def rates(alpha: float, q: float, elevator: float) -> tuple[float, float]:
        return float(model.alpha_dot(alpha, q, elevator)), float(model.q_dot(alpha, q, elevator))

    planned = plan_flights(study.maneuvers, rates, study.flight)
    plans = {plan.name: plan for plan in planned.plans}
    counts: dict[str, int] = {}
    named = {}
    for maneuver in study.maneuvers:
        counts[maneuver.kind] = counts.get(maneuver.kind, 0) + 1
        name = f"{maneuver.kind}-{counts[maneuver.kind]:02d}"
        if name in plans:
            named[name] = (plans[name], maneuver)
    return named, list(planned.notes)


def _flight(plan: FlightPlan) -> PlannedFlight:
    samples = int(plan.duration_s / plan.sample_interval_s + 1e-6) + 1
    return PlannedFlight(
        name=plan.name,
        elevator_rad=plan.schedule.value(np.arange(samples) * plan.sample_interval_s),
        hold=plan.hold.value,
        interval_s=plan.sample_interval_s,
        alpha_rad=plan.alpha_rad,
        q_rad_s=plan.q_rad_s,
    )
