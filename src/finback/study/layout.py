"""How a text table is written, as a study or a map says it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, ValidationInfo, field_validator

from finback.formats.text_table import TextFormat
from finback.study.tables import Table


class LayoutTable(Table):
    """Keys of a text table's layout; what is empty is found out."""

    separator: Annotated[str, Field(max_length=1)] = ""
    skip_lines: Annotated[int, Field(ge=0)] = 0
    skip_rows: Annotated[int, Field(ge=0)] = 0
    thousands: Annotated[str, Field(max_length=1)] = ""
    encoding: str = ""
    decimal: Annotated[str, Field(pattern="^[.,]$", validate_default=True)] = "."  # last: it sees the others

    @field_validator("decimal")
    @classmethod
    def _unlike(cls, decimal: str, info: ValidationInfo) -> str:
        if decimal in {info.data.get("thousands"), info.data.get("separator")}:
            raise ValueError("cannot separate cells or groups and be the decimal sign as well")
        return decimal

    @property
    def text_format(self) -> TextFormat:
        """The same for whoever reads the table."""
        return TextFormat(
            separator=self.separator,
            skip_lines=self.skip_lines,
            skip_rows=self.skip_rows,
            decimal=self.decimal,
            thousands=self.thousands,
            encoding=self.encoding,
        )
