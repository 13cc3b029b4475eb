"""Coefficients from flights of any origin, and the dimensional model that they are at a condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from finback.errors import InputError
from finback.files import sha256
from finback.flight.flat_earth import FLATTENED
from finback.identification.coefficient.identify import CoefficientIdentification, identify_coefficients
from finback.identification.coefficient.options import Biases, CoefficientMethod, CoefficientOptions
from finback.pipeline.progress import SILENCE, Progress
from finback.records import Sweep
from finback.store.coefficient_setup import CoefficientSetup, read_coefficient_setup
from finback.store.coefficients import read_flights, save_coefficients, write_reduced
from finback.store.envelope import SWEEP


def coefficients(
    setup_file: Path,
    sources: Sequence[Path],
    *,
    output: Path,
    reduced: tuple[Path, ...] = (),
    methods: tuple[CoefficientMethod, ...] = (),
    progress: Progress = SILENCE,
) -> CoefficientIdentification:
    """Fit CX, CZ (or CD, CL) and Cm to flights and write them.

    Args:
        setup_file: airframe, terms, method, and how tables are read (docs/coefficients.md).
        sources: folders of runs, and tables.
        output: the file of the result.
        reduced: where the model at the setup's condition is written for ``analyze``; or empty.
        methods: one estimator, whatever the setup says; or empty. Biases of the setup that it has no place for are
            left out, with a warning.
        progress: who wants to know.

    Raises:
        FaultyFileError: the setup has faults.
        InputError: a flight cannot be read or lacks what is needed.
        RefusedError: the data cannot determine every number.
    """
    for path in (output, *reduced):
        if path.is_dir() or not path.parent.is_dir():
            raise InputError(f"{path} cannot be written", hint="name a file in a folder that is there")
    setup = read_coefficient_setup(setup_file)
    progress.begin("coefficients", 0)
    options, said = _with_method(setup.options, methods)
    flights = read_flights(sources, replace(setup, options=options))
    found = identify_coefficients(flights, options)
    found = replace(found, warnings=(*said, *_still(setup), *_flattened(flights), *found.warnings))
    made_of = {str(source): sha256(source / SWEEP.file if source.is_dir() else source) for source in sources}
    save_coefficients(found, output, inputs={str(setup_file): setup.sha256, **made_of})
    for path in reduced:
        write_reduced(
            found.model.reduced(setup.condition),
            path,
            name=output.stem,
            condition=setup.condition,
            thrust_n=found.model.airframe.thrust_n,
        )
    return found


def _flattened(flights: Sweep) -> tuple[str, ...]:
    """Say what was changed in flights of the harness, that the equations over a flat Earth are theirs."""
    changes = [record.provenance[FLATTENED] for record in flights.records if FLATTENED in record.provenance]
    if not changes:
        return ()
    return (f"{len(changes)} flights of runs are made flights over a flat Earth; of the first, {changes[0]}",)


def _still(setup: CoefficientSetup) -> tuple[str, ...]:
    """Say what an airspeed that was not recorded does to the numbers."""
    if not setup.still:
        return ()
    said = (
        f"no airspeed was recorded: {setup.condition.airspeed_m_s:g} m/s, that of the condition, stands for it; where "
        "it moved, CD and all terms are wrong by what the dynamic pressure and dV/dt did, beyond their errors"
    )
    return (said,)


def _with_method(
    options: CoefficientOptions, methods: tuple[CoefficientMethod, ...]
) -> tuple[CoefficientOptions, tuple[str, ...]]:
    """Return the options with another method, and what of them it leaves out."""
    if not methods:
        return options, ()
    (method,) = methods
    if method.of_likelihood or options.biases == Biases():
        return replace(options, method=method), ()
    said = f"the [biases] of the setup are left out: {method} estimates none, so they stay in the coefficients"
    return replace(options, method=method, biases=Biases()), (said,)
