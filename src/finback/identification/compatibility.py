"""Kinematic compatibility: whether alpha, pitch, airspeed, rates and accelerations of a record tell one motion.

No aerodynamics is in it: the measured rates and specific forces are integrated (Newton and Euler), and what comes out
is compared with the measured alpha, pitch angle and airspeed. Biases, scales and delays of the instruments are what
makes them agree. Source: Klein & Morelli 2006, Aircraft System Identification, ch. 10; Jategaonkar 2015, ch. 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_simpson
from scipy.interpolate import CubicSpline

from finback.arrays import FloatArray
from finback.dynamics.lienard import NORMAL_95
from finback.errors import RefusedError
from finback.identification.coloring import corrected_covariance
from finback.records import FlightRecord
from finback.units import quantity_of, unit_of

_OUTPUTS: Final = ("alpha_rad", "theta_rad", "airspeed_m_s")
_FORCES: Final = ("ax_m_s2", "az_m_s2")
_CREDIBLE: Final = {
    "q bias": 0.05,
    "ax bias": 2.0,
    "az bias": 2.0,
    "ax delay": 0.3,
    "alpha bias": 0.1,
    "alpha scale": 0.5,
    "alpha delay": 0.3,
    "airspeed scale": 0.3,
    "airspeed delay": 2.0,
    "theta scale": 0.2,
    "theta delay": 0.3,
}
"""Largest faults (SI) of instruments that fly; a record that knows one no better than this does not know it."""
_STEPS: Final = 12
_CONVERGED: Final = 1e-3  # standard errors
_TINY: Final = 1e-12
_DRAWS: Final = 100  # of the noise of the inputs: a standard error is then right to 7 %
_DRAW_SEED: Final = 20  # the same record gives the same numbers
_NORMAL_QUARTILE: Final = 0.6744897501960817  # median |x| of a standard normal x
_FEWEST: Final = 20
_JITTER: Final = 0.05  # of the interval: as ``stretch`` bears it
_STEP: Final = 1e-4  # of a parameter's size: central differences of a smooth least-squares problem


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentError:
    """One fault of one instrument.

    The measured value is scale · true(t − delay) + bias.

    Attributes:
        name: such as ``alpha bias``, ``alpha scale``, ``theta delay``.
        unit: SI unit suffix of the three numbers.
        value: the estimate; of a scale, what it differs from 1.
        standard_error: colored residuals allowed for; infinite if the record cannot tell (``value`` is 0 then).
        known: whether the record can tell it from the others.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    known: bool

    @property
    def significant(self) -> bool:
        """Whether 0 lies outside the 95 % interval."""
        return self.known and abs(self.value) > NORMAL_95 * self.standard_error


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Compatibility:
    """What the kinematics say of a record's instruments.

    Attributes:
        flight: the record's name.
        errors: every fault that was looked for.
        rms: output name -> root mean square of the residual, in SI.
        noise_rms: output name -> the part of it that changes from sample to sample: the instrument's noise.
        not_checked: what could not be looked at and why, one sentence each.
    """

    flight: str
    errors: tuple[InstrumentError, ...]
    rms: dict[str, float]
    noise_rms: dict[str, float]
    not_checked: tuple[str, ...]

    def value(self, name: str) -> float:
        """Return an estimate by name; 0 if it was not looked for."""
        return next((error.value for error in self.errors if error.name == name), 0.0)


def check_compatibility(record: FlightRecord) -> Compatibility:
    """Estimate biases, scales and delays of the instruments of one flight.

    Needs ``q_rad_s`` and at least one of alpha with both specific forces and airspeed, or pitch angle. ``p``, ``r``,
    ``beta`` and ``phi`` are taken as measured, or 0 where there are none. The delays are against the pitch rate.

    Args:
        record: a flight on a uniform time base, without missing samples.

    Raises:
        RefusedError: a channel that is needed is missing, samples are missing or not uniform, or the flight is too
            short (20 samples).
    """
    problem = _Problem(record)
    names = list(problem.parameters)
    values, active, noise = _fit(problem, names)
    return _report(problem, names, values, active, noise)


@final
class _Problem:
    """Measured channels, and the motion that they imply for given faults."""

    def __init__(self, record: FlightRecord) -> None:
        self.record = record
        self.time = record["time_s"]
        self.gravity = record.condition.gravity_m_s2
        self.not_checked: list[str] = []
        _check_samples(record)
        self.interval = float(np.median(np.diff(self.time)))
        translation = all(name in record.columns for name in (*_FORCES, "alpha_rad", "airspeed_m_s"))
        if not translation:
            missing = [name for name in (*_FORCES, "alpha_rad", "airspeed_m_s") if name not in record.columns]
            self.not_checked.append(f"alpha, airspeed and specific forces: there is no {', '.join(missing)}")
        if "theta_rad" not in record.columns:
            self.not_checked.append("pitch angle: there is no theta_rad")
        self.outputs = tuple(
            name for name in _OUTPUTS if name in record.columns and (translation or name == "theta_rad")
        )
        if not self.outputs:
            raise RefusedError(
                f"flight '{record.name}': its kinematics cannot be checked: {'; '.join(self.not_checked)}",
                hint="record the pitch angle, or airspeed and specific forces",
            )
        self.translation = translation
        # name -> size of a usual fault: it scales the search and nothing else
        self.parameters = {"q bias": 1e-3}
        if translation:
            self.parameters |= {"ax bias": 0.1, "az bias": 0.1, "ax delay": self.interval, "alpha bias": 5e-3}
            self.parameters |= {"alpha scale": 0.02, "alpha delay": self.interval}
            self.parameters |= {"airspeed scale": 0.01, "airspeed delay": 10.0 * self.interval}
        if "theta_rad" in self.outputs:
            self.parameters |= {"theta scale": 0.01, "theta delay": self.interval}
        # The start is a parameter like others, but no fault of an instrument.
        self.parameters |= {f"start {name}": size for name, size in self._starts().items()}

    def _starts(self) -> dict[str, float]:
        return {"theta": 5e-3, **({"u": 1.0, "w": 1.0} if self.translation else {})}

    def residuals(self, faults: dict[str, float]) -> FloatArray:
        """Return measured less implied, shape (n, outputs), in SI."""
        implied = self._motion(faults)
        columns = []
        for output in self.outputs:
            quantity = quantity_of(output)
            true = _delayed(self.time, implied[output], faults.get(f"{quantity} delay", 0.0))
            value = (1.0 + faults.get(f"{quantity} scale", 0.0)) * true + faults.get(f"{quantity} bias", 0.0)
            columns.append(self.record[output] - value)
        return np.column_stack(columns)

    def _motion(self, faults: dict[str, float]) -> dict[str, FloatArray]:
        """Integrate: with Q = ∫ q dt, ζ = u + i w obeys ζ' = i q ζ + f, so ζ = e^{iQ} (ζ₀ + ∫ e^{−iQ} f dt)."""
        record, time = self.record, self.time
        q = record["q_rad_s"] - faults["q bias"]
        p, r, phi = (record.or_zero(name) for name in ("p_rad_s", "r_rad_s", "phi_rad"))
        turned = cumulative_simpson(q * np.cos(phi) - r * np.sin(phi), x=time, initial=0.0)
        theta = float(record.or_zero("theta_rad")[0]) + faults["start theta"] + turned
        if not self.translation:
            return {"theta_rad": theta}
        late = faults["ax delay"]
        ax = _delayed(time, record["ax_m_s2"], -late) - faults["ax bias"]
        az = _delayed(time, record["az_m_s2"], -late) - faults["az bias"]
        v = record["airspeed_m_s"] * np.sin(record.or_zero("beta_rad"))
        along = r * v - self.gravity * np.sin(theta) + ax
        down = -p * v + self.gravity * np.cos(theta) * np.cos(phi) + az
        turn = np.exp(1j * cumulative_simpson(q, x=time, initial=0.0))
        inflow = (along + 1j * down) / turn
        path = cumulative_simpson(inflow.real, x=time, initial=0.0) + 1j * cumulative_simpson(
            inflow.imag, x=time, initial=0.0
        )
        start = record["airspeed_m_s"][0] * np.exp(1j * record["alpha_rad"][0])
        motion = turn * (start + faults["start u"] + 1j * faults["start w"] + path)
        return {
            "alpha_rad": np.angle(motion),
            "theta_rad": theta,
            "airspeed_m_s": np.sqrt(np.abs(motion) ** 2 + v * v),
        }


def _fit(problem: _Problem, names: Sequence[str]) -> tuple[FloatArray, NDArray[np.bool_], FloatArray]:
    """Return the faults, which of them the record can tell, and the noise of each output, by Gauss-Newton steps.

    What the record cannot tell, at its own noise, better than the largest fault that is credible, is given up: the
    worst first, judged again without it.
    """
    credible = np.array([_CREDIBLE.get(name, np.inf) for name in names])
    values, active = np.zeros(len(names)), np.ones(len(names), dtype=bool)
    noise = np.maximum(np.std(np.diff(problem.residuals(_named(names, values)), axis=0), axis=0) / np.sqrt(2.0), _TINY)
    for _ in range(_STEPS):
        residuals = problem.residuals(_named(names, values))
        slopes = _slopes(problem, names, values) / noise[:, np.newaxis]
        while True:
            rows = slopes[:, :, active].reshape(-1, int(active.sum()))
            deviations = np.sqrt(np.diag(np.linalg.pinv(rows.T @ rows, hermitian=True)))
            excess = np.where(_null(rows), np.inf, deviations) / credible[active]
            if excess.max() <= 1.0:
                break
            active[np.flatnonzero(active)[int(excess.argmax())]] = False
            values[~active] = 0.0
        step = np.linalg.lstsq(rows, (residuals / noise).ravel(), rcond=None)[0]
        values[active] = np.clip(values[active] + step, -credible[active], credible[active])
        active &= np.abs(values) < credible  # pushed to its limit by the others: it is not this record that says so
        values[~active] = 0.0
        left = problem.residuals(_named(names, values))
        noise = np.maximum(np.sqrt(np.mean(left**2, axis=0)), _TINY)
        if step.size == int(active.sum()) and (np.abs(step) <= _CONVERGED * deviations).all():
            break
    return values, active, noise


def _null(rows: FloatArray) -> NDArray[np.bool_]:
    """Return which columns say nothing at all."""
    size = np.linalg.norm(rows, axis=0)
    return np.asarray(size <= np.finfo(np.float64).eps * size.max())


def _slopes(problem: _Problem, names: Sequence[str], values: FloatArray) -> FloatArray:
    """Return d(implied)/d(fault) of every output, shape (n, outputs, faults), by central differences."""
    columns = []
    for index, name in enumerate(names):
        step = np.zeros(len(names))
        step[index] = _STEP * problem.parameters[name]
        above, below = (problem.residuals(_named(names, values + way * step)) for way in (1.0, -1.0))
        columns.append((below - above) / (2.0 * step[index]))
    return np.stack(columns, axis=2)


def _named(names: Sequence[str], values: FloatArray) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def _report(
    problem: _Problem, names: Sequence[str], found: FloatArray, active: NDArray[np.bool_], noise: FloatArray
) -> Compatibility:
    inside = np.flatnonzero(active)
    residuals = problem.residuals(_named(names, found))
    slopes = _slopes(problem, names, found)[:, :, active]
    influence = slopes / noise[:, np.newaxis]
    information = np.einsum("nop,noq->pq", influence, influence)
    covariance = corrected_covariance(np.linalg.pinv(information, hermitian=True), [influence], [residuals / noise])
    covariance += _of_inputs(problem, _named(names, found), residuals, slopes, noise)
    deviations = np.full(len(names), np.inf)
    deviations[inside] = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    changes = np.diff(residuals, axis=0)
    return Compatibility(
        flight=problem.record.name,
        errors=tuple(
            InstrumentError(
                name=name,
                unit=_unit_of(name),
                value=float(found[index]),
                standard_error=float(deviations[index]),
                known=bool(active[index]),
            )
            for index, name in enumerate(names)
            if not name.startswith("start")
        ),
        rms={name: float(np.sqrt(np.mean(residuals[:, k] ** 2))) for k, name in enumerate(problem.outputs)},
        noise_rms={name: float(np.std(changes[:, k]) / np.sqrt(2.0)) for k, name in enumerate(problem.outputs)},
        not_checked=tuple(problem.not_checked),
    )


def _of_inputs(
    problem: _Problem, faults: dict[str, float], residuals: FloatArray, slopes: FloatArray, noise: FloatArray
) -> FloatArray:
    """Return what the noise of the rates and forces adds to the covariance.

    It is integrated, so the residuals show it as a slow drift that the parameters take up; it is put in again, drawn
    anew, and what the parameters would make of it is counted.
    """
    weighted = (slopes / noise[:, np.newaxis]).reshape(-1, slopes.shape[-1])
    solve = np.linalg.pinv(weighted)
    random = np.random.default_rng(_DRAW_SEED)
    draws = []
    for _ in range(_DRAWS):
        moved = {
            name: problem.record[name]
            + _white_noise(problem.record[name]) * random.standard_normal(len(problem.record))
            for name in ("q_rad_s", *_FORCES)
            if name in problem.record.columns
        }
        change = _Problem(problem.record.with_columns(**moved)).residuals(faults) - residuals
        draws.append(solve @ (change / noise).ravel())
    return np.asarray(np.cov(np.array(draws).T)).reshape(slopes.shape[-1], slopes.shape[-1])


def _white_noise(values: FloatArray) -> float:
    """Return the standard deviation of the white part of a smooth column: of its third differences, over √20."""
    return float(np.median(np.abs(np.diff(values, n=3))) / _NORMAL_QUARTILE / np.sqrt(20.0))


def corrected(record: FlightRecord, found: Compatibility) -> tuple[FlightRecord, tuple[str, ...]]:
    """Return the record with every significant fault taken out, and what was done, a sentence for each.

    A fault whose 95 % interval holds 0 is left alone. A fault that is not among those looked for (a bias of the pitch
    angle or of the airspeed, a scale of the forces) is explained by these: look at the findings before taking them out.
    """
    columns: dict[str, FloatArray] = {}
    said = []
    for error in found.errors:
        if not error.significant:
            continue
        instrument, kind = error.name.rsplit(" ", 1)
        targets = ("ax_m_s2", "az_m_s2") if error.name == "ax delay" else (_CHANNELS[instrument],)
        for name in targets:
            values = columns.get(name, record[name])
            if kind == "bias":
                values = values - error.value
            elif kind == "scale":
                values = values / (1.0 + error.value)
            else:
                values = _delayed(record["time_s"], values, -error.value)
            columns[name] = values
        said.append(f"{error.name}: {error.value:.4g} ± {NORMAL_95 * error.standard_error:.2g} {error.unit} taken out")
    return record.with_columns(**columns), tuple(said)


_CHANNELS: Final = {
    "q": "q_rad_s",
    "ax": "ax_m_s2",
    "az": "az_m_s2",
    "alpha": "alpha_rad",
    "airspeed": "airspeed_m_s",
    "theta": "theta_rad",
}


def _unit_of(name: str) -> str:
    instrument, kind = name.rsplit(" ", 1)
    return {"scale": "1", "delay": "s"}.get(kind) or unit_of(_CHANNELS[instrument])


def _delayed(time: FloatArray, values: FloatArray, delay_s: float) -> FloatArray:
    """Return values(t − delay), by a cubic spline, held at the ends."""
    return (
        values if delay_s == 0.0 else np.asarray(CubicSpline(time, values)(np.clip(time - delay_s, time[0], time[-1])))
    )


def _check_samples(record: FlightRecord) -> None:
    place = f"flight '{record.name}'"
    if "q_rad_s" not in record.columns:
        raise RefusedError(f"{place}: its kinematics cannot be checked without q_rad_s")
    if len(record) < _FEWEST:
        raise RefusedError(f"{place}: {len(record)} samples are too few for its kinematics, expected {_FEWEST}")
    used = [
        name
        for name in (*_OUTPUTS, *_FORCES, "q_rad_s", "p_rad_s", "r_rad_s", "phi_rad", "beta_rad")
        if name in record.columns
    ]
    missing = [name for name in used if not np.isfinite(record[name]).all()]
    steps = np.diff(record["time_s"])
    if missing or np.abs(steps - np.median(steps)).max() > _JITTER * np.median(steps):
        what = f"missing samples in {', '.join(missing)}" if missing else "samples that are not uniform in time"
        raise RefusedError(f"{place} has {what}", hint="put it on a uniform time base first (identification.uniform)")
