"""A flown case on disk: ``.parquet`` or ``.csv``, columns in SI with the unit in the name."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from finback.errors import InputError
from finback.files import replacing
from finback.flight.case import FlownCase
from finback.units import unit_of


def save_case(flown: FlownCase, path: Path) -> None:
    """Write all columns as float64; a CSV holds 17 digits, so both give back the same bits.

    Raises:
        InputError: the name of the file ends in neither.
    """
    if path.suffix not in {".parquet", ".csv"}:
        raise InputError(f"{path} ends in neither .parquet nor .csv")
    with replacing(path) as part:
        if path.suffix == ".csv":
            import pandas as pd  # noqa: PLC0415 - half a second, for this kind of file only

            pd.DataFrame(dict(flown.columns)).to_csv(part, index=False, float_format="%.17g")
            return
        fields = [pa.field(name, pa.float64(), metadata=_facts(flown, name)) for name in flown.columns]
        facts = {**flown.provenance, "outcome": flown.outcome.value, "note": flown.note}
        pq.write_table(pa.table(list(flown.columns.values()), schema=pa.schema(fields, metadata=facts)), part)


def _facts(flown: FlownCase, name: str) -> dict[str, str]:
    """Return what is kept beside a column: its unit and, if it is known, the estimated error of the step."""
    error = {"step_error": repr(flown.step_error[name])} if name in flown.step_error else {}
    return {"unit": unit_of(name), **error}
