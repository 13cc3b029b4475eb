"""Kinematic compatibility: whether alpha, airspeed, attitude, rates and accelerations of flights tell one motion.

No aerodynamics is in it: the measured rates and specific forces are integrated (Newton and Euler), and what comes out
is compared with the measured airspeed, flow angles, attitude and height. Biases, scales and delays of the instruments
are what makes them agree. Sources: Klein & Morelli 2006, Aircraft System Identification, chapter 10; Jategaonkar 2015,
Flight Vehicle System Identification, chapter 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from finback.arrays import FloatArray
from finback.errors import RefusedError
from finback.identification.compatibility.air import AXES
from finback.identification.compatibility.fault import (
    ATTITUDES,
    FLOW,
    FORCES,
    OUTPUTS,
    RATES,
    CompatibilityOptions,
    Fault,
    faults_of,
)
from finback.identification.compatibility.judgement import Combination, InstrumentError, judged
from finback.identification.compatibility.piece import Piece, input_noise, start_guess, without_holes
from finback.identification.compatibility.reconstruction import Reconstruction, reconstruct
from finback.identification.uniform import record_on
from finback.records import FlightRecord
from finback.units import from_si, quantity_of, unit_of

_FEWEST: Final = 20
_JITTER: Final = 0.05  # of the interval: as ``stretch`` bears it
_GAP: Final = 1.5  # intervals
_LONGEST_S: Final = 60.0
_MOST_ROWS: Final = 6_000
"""Of a piece: beyond a minute the integrated noise of the inputs has forgotten how it began."""
_ROWS: Final = 60_000
"""Of all pieces together: those that move most are taken."""
_UNEXPLAINED: Final = 5.0  # times the noise
_STORM_M_S: Final = 10.0
"""Gusts beyond which no air explains what is left: severe turbulence has 21 ft/s, 6.4 m/s (MIL-F-8785C, 3.7), which a
record of few correlation times tells to a factor of some 1.5."""
_WAY_OUT: Final = "a unit, a sign or the place of a sensor may be wrong"
_NO_END: Final = "the estimate of the instruments' faults did not settle, which says nothing against them"
_LONGER: Final = (
    "give longer pieces with more motion, or set the faults that are known to be none to 0 in [instruments]"
)
_LEVEL_RAD: Final = 0.05
"""Bank up to which a flight without measured roll and yaw rates passes for one in the vertical plane."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Air:
    """How the air moved about its mean.

    Attributes:
        gusts_m_s: channel of the flow -> standard deviation of the air's velocity that it shows; empty if nothing is
            told from noise.
        gust_s: correlation time.
    """

    gusts_m_s: dict[str, float]
    gust_s: float

    @property
    def moved(self) -> bool:
        """Whether gusts were found."""
        return bool(self.gusts_m_s)

    def sentence(self) -> str:
        """Say the gusts."""
        sizes = ", ".join(f"{quantity_of(name)} by {speed:.2g} m/s" for name, speed in self.gusts_m_s.items())
        return (
            f"beside the aircraft's own motion the air moves {sizes} (correlation time {self.gust_s:.2g} s): gusts, or "
            "noise that is not white"
        )


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Compatibility:
    """What the kinematics say of the instruments.

    Attributes:
        flights: names of the records.
        errors: every fault that was looked for.
        combinations: what is known of faults that are not known one by one.
        correlated: pairs of determined faults whose estimates hang together, with their correlation.
        rms: output name -> root mean square of the residual, in SI.
        noise_rms: output name -> the part of it that changes from sample to sample: the instrument's noise.
        air: gusts, as far as the flow tells them from the aircraft's motion.
        not_checked: what could not be looked at and why, one sentence each.
    """

    flights: tuple[str, ...]
    errors: tuple[InstrumentError, ...]
    combinations: tuple[Combination, ...]
    correlated: tuple[tuple[str, str, float], ...]
    rms: dict[str, float]
    noise_rms: dict[str, float]
    air: Air
    not_checked: tuple[str, ...]

    def error(self, name: str) -> InstrumentError:
        """Return a fault by name.

        Raises:
            KeyError: it was not looked for.
        """
        return {error.name: error for error in self.errors}[name]


def check_compatibility(records: Sequence[FlightRecord], options: CompatibilityOptions | None = None) -> Compatibility:
    """Estimate biases, scales and delays of the instruments that some flights share.

    Needs ``q_rad_s``, and either an attitude angle, or both of ``ax_m_s2`` and ``az_m_s2`` with ``airspeed_m_s`` or
    ``alpha_rad``. With ``p_rad_s`` and ``r_rad_s`` the motion is followed in all six degrees of freedom (the sideward
    one needs ``ay_m_s2``, else the measured sideslip is taken); without them it must be one in the vertical plane. Air
    that moves uniformly changes nothing; if the altitude is there, a constant vertical wind of each piece is estimated.
    Delays are against the pitch rate.

    Args:
        records: flights with the same instruments, each on a uniform time base; gaps divide them.
        options: what is known of the instruments beforehand.

    Raises:
        RefusedError: a channel that is needed is missing, samples are not uniform, or nothing is long enough (20
            samples), or the motion cannot be made to agree at all.
    """
    asked = options or CompatibilityOptions()
    notes: list[str] = []
    outputs, translation = _comparable(records, notes)
    found = _reconstructed(records, outputs, asked, notes, translation=translation)
    attitudes = tuple(name for name in outputs if name in ATTITUDES)
    if translation and attitudes and (_doubts(found) or not found.converged):
        # What does not fit may have bent all else; the attitudes need neither flow nor forces.
        notes += _without_flow(_doubts(found))
        found = _reconstructed(records, attitudes, asked, notes, translation=False)
    doubts = _doubts(found)
    if doubts:
        raise RefusedError(
            f"{_names(records)}: the instruments do not tell one motion: {'; '.join([*doubts, *notes])}",
            hint=_WAY_OUT,
        )
    if not found.converged:
        raise RefusedError(f"{_names(records)}: {'; '.join([_NO_END, *notes])}", hint=_LONGER)
    return _compatibility(records, found, _sizes(found.faults, asked), notes)


def _reconstructed(
    records: Sequence[FlightRecord],
    outputs: tuple[str, ...],
    options: CompatibilityOptions,
    notes: list[str],
    *,
    translation: bool,
) -> Reconstruction:
    sideward = translation and all(name in record.columns for record in records for name in _SIX)
    pieces = [
        piece for record in records for piece in _pieces(record, outputs, translation=translation, sideward=sideward)
    ]
    if not pieces:
        raise RefusedError(
            f"{_names(records)}: no {_FEWEST} samples without a gap in what the motion is integrated from",
            hint="record longer, or interpolate longer gaps",
        )
    used = _most_moved(pieces, notes)
    driven = (*RATES, *(FORCES if translation else ()))
    channels = [
        name
        for name in (*driven, *outputs)
        if all(name in record.columns for record in records) and (name != "ay_m_s2" or sideward)
    ]
    faults = tuple(fault for name in channels for fault in faults_of(name) if options.size(fault) > 0.0)
    return reconstruct(used, faults, _sizes(faults, options))


def _sizes(faults: tuple[Fault, ...], options: CompatibilityOptions) -> FloatArray:
    return np.array([options.size(fault) for fault in faults])


_SIX: Final = ("p_rad_s", "r_rad_s", "ay_m_s2")


def _comparable(records: Sequence[FlightRecord], notes: list[str]) -> tuple[tuple[str, ...], bool]:
    """Return the channels that can be compared, and whether velocities are among them."""
    if not records:
        raise RefusedError("there is no flight whose kinematics could be checked")
    for record in records:
        if "q_rad_s" not in record.columns:
            raise RefusedError(
                f"flight '{record.name}': its kinematics cannot be checked without q_rad_s",
                hint="record the pitch rate: from an angle it would be the very thing it is compared with",
            )
    there = {name for name in (*OUTPUTS, *FORCES, *RATES) if all(name in record.columns for record in records)}
    plane = not {"p_rad_s", "r_rad_s"} <= there
    if plane:
        for record in records:
            bank = float(np.nanmax(np.abs(record.or_zero("phi_rad")), initial=0.0))
            if bank > _LEVEL_RAD:
                raise RefusedError(
                    f"flight '{record.name}' banks by {from_si(bank, 'deg'):.3g} deg: its kinematics cannot be checked "
                    "without p_rad_s and r_rad_s"
                )
        notes.append("roll and yaw rates are not recorded: the flight is taken for one in the vertical plane")
    forces = [name for name in ("ax_m_s2", "az_m_s2") if name not in there]
    flow = [name for name in FLOW[:2] if name in there]
    translation = not forces and bool(flow)
    if not translation:
        missing = forces or list(FLOW[:2])
        notes.append(f"alpha, airspeed and specific forces: there is no {', '.join(missing)}")
    notes += [f"{quantity_of(name)}: there is no {name}" for name in ("theta_rad", *_missed(flow, translation))
              if name not in there]  # fmt: skip
    lateral = () if plane else ("beta_rad",) if "ay_m_s2" in there else ()
    wanted = (*(FLOW[:2] if translation else ()), *(lateral if translation else ()),
              *(("theta_rad",) if plane else ATTITUDES), *(("altitude_m",) if translation else ()))  # fmt: skip
    outputs = tuple(name for name in wanted if name in there)
    if not outputs:
        raise RefusedError(
            f"{_names(records)}: kinematics cannot be checked: {'; '.join(notes)}",
            hint="record the pitch angle, or airspeed and specific forces",
        )
    return outputs, translation


def _missed(flow: Sequence[str], translation: bool) -> tuple[str, ...]:  # noqa: FBT001 - one word for one truth value
    """Return which of airspeed and alpha are missed, if any velocity is compared."""
    return tuple(name for name in FLOW[:2] if name not in flow) if translation else ()


def _pieces(record: FlightRecord, outputs: tuple[str, ...], *, translation: bool, sideward: bool) -> tuple[Piece, ...]:
    """Cut a record where an input is missing, and into pieces short enough to remember how they began."""
    time = record["time_s"]
    if time.size < _FEWEST:
        return ()
    steps = np.diff(time)
    typical = float(np.median(steps))
    needed = [name for name in (*RATES, *(FORCES if translation else ())) if name in record.columns]
    whole = without_holes(record)
    known = np.asarray(np.isfinite(np.column_stack([whole[name] for name in needed])).all(axis=1))
    breaks = np.flatnonzero(~known[1:] | ~known[:-1] | (steps > _GAP * typical)) + 1
    longest = max(_FEWEST, min(_MOST_ROWS, round(_LONGEST_S / typical)))
    found: list[Piece] = []
    for run in np.split(np.arange(time.size), breaks):
        if run.size < _FEWEST or not known[run].all():
            continue
        found += [
            _piece(record, part, outputs, translation=translation, sideward=sideward)
            for part in np.array_split(run, -(-run.size // longest))
        ]
    return tuple(piece for piece in found if _compared(piece))


def _piece(
    record: FlightRecord, rows: NDArray[np.int64], outputs: tuple[str, ...], *, translation: bool, sideward: bool
) -> Piece:
    sampled = _rows(record, rows)
    part = _rows(without_holes(record), rows)
    time = part["time_s"]
    interval = float(time[-1] - time[0]) / (time.size - 1)
    stray = float(np.abs(time - np.linspace(time[0], time[-1], time.size)).max())
    if stray > _JITTER * interval:
        raise RefusedError(
            f"flight '{record.name}' has samples that are not uniform in time (up to {stray:.3g} s beside a grid of "
            f"{interval:.6g} s)",
            hint="put it on a uniform time base first (identification.uniform)",
        )
    return Piece(
        record=part,
        interval_s=interval,
        outputs=outputs,
        translation=translation,
        sideward=sideward,
        guess=start_guess(part, translation=translation),
        process=input_noise(sampled, translation=translation),
    )


def _rows(record: FlightRecord, rows: NDArray[np.int64]) -> FlightRecord:
    return record_on(
        record,
        record["time_s"][rows],
        {name: values[rows] for name, values in record.columns.items() if name != "time_s"},
    )


def _compared(piece: Piece) -> bool:
    return any(np.isfinite(piece.record[name]).sum() >= _FEWEST for name in piece.outputs)


def _most_moved(pieces: list[Piece], notes: list[str]) -> list[Piece]:
    """Return the pieces that move most, as many as are affordable."""
    order = np.argsort([-float(np.std(piece.record["q_rad_s"])) for piece in pieces], kind="stable")
    chosen: list[int] = []
    rows = 0
    for index in order.tolist():
        if chosen and rows + len(pieces[index].record) > _ROWS:
            break
        chosen.append(index)
        rows += len(pieces[index].record)
    if len(chosen) < len(pieces):
        notes.append(f"{len(chosen)} of {len(pieces)} pieces were used, those of the largest pitch rates")
    return [pieces[index] for index in sorted(chosen)]


def _doubts(found: Reconstruction) -> list[str]:
    """Name outputs whose residual is far beyond the noise that can be seen on them, and air that no weather moves."""
    white = np.sqrt(np.mean([piece.output_noise() for piece in found.pieces], axis=0))
    left = np.sqrt(found.disturbance.noise)
    strongest = max(found.disturbance.gusts_m_s)
    storm = f"gusts of {strongest:.2g} m/s would be needed, more than severe turbulence has"
    unexplained = [
        f"{name}: {rest:.2g} {unit_of(name)} are left, {rest / noise:.2g} times its noise: no fault that is looked for "
        "explains it"
        for name, rest, noise in zip(found.pieces[0].outputs, left.tolist(), white.tolist(), strict=True)
        if rest > _UNEXPLAINED * noise
    ]
    return [*unexplained, *([storm] if strongest > _STORM_M_S else [])]


def _without_flow(doubts: Sequence[str]) -> list[str]:
    """Say why airspeed, flow angles and forces are left out: they contradict each other, or nothing came of it."""
    compared = "airspeed, flow angles and forces"
    if doubts:
        return [*doubts, f"{compared}: they do not tell one motion: {_WAY_OUT}"]
    return [f"{compared}: {_NO_END}: {_LONGER}"]


def _compatibility(
    records: Sequence[FlightRecord], found: Reconstruction, sizes: FloatArray, notes: list[str]
) -> Compatibility:
    outcome = judged(found.faults, found.values, found.covariance, sizes)
    outputs = found.pieces[0].outputs
    left = [np.concatenate([piece[:, k] for piece in found.residuals]) for k in range(len(outputs))]
    left = [column[np.isfinite(column)] for column in left]
    return Compatibility(
        flights=tuple(record.name for record in records),
        errors=outcome.errors,
        combinations=outcome.combinations,
        correlated=outcome.correlated,
        rms={name: float(np.sqrt(np.mean(e**2))) for name, e in zip(outputs, left, strict=True) if e.size},
        noise_rms={
            name: float(np.std(np.diff(e)) / np.sqrt(2.0)) for name, e in zip(outputs, left, strict=True) if e.size > 1
        },
        air=Air(
            gusts_m_s={name: found.disturbance.gusts_m_s[AXES[name]] for name in outputs if name in FLOW}
            if found.disturbance.moves
            else {},
            gust_s=found.disturbance.gust_s,
        ),
        not_checked=tuple(notes),
    )


def _names(records: Sequence[FlightRecord]) -> str:
    names = [f"'{record.name}'" for record in records]
    return f"flight {names[0]}" if len(names) == 1 else f"flights {', '.join(names[:3])}{' …' if names[3:] else ''}"
