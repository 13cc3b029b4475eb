"""Text files of columns: what is read, and what every fault says."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from finback.errors import InputError
from finback.formats.text_table import read_text_table


def _write(path: Path, text: str, encoding: str = "utf-8") -> Path:
    file = path / "it.csv"
    file.write_bytes(text.encode(encoding))
    return file


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_the_separator_is_found(tmp_path: Path, separator: str) -> None:
    table = read_text_table(
        _write(
            tmp_path, f"t{separator}a (deg){separator}b\n0{separator}1e-3{separator}\n1{separator} 2 {separator}NaN\n"
        )
    )
    np.testing.assert_array_equal(table.numbers("a (deg)"), [1e-3, 2.0])
    assert np.isnan(table.numbers("b")).all()


def test_a_mark_quotes_and_lines_before_the_names(tmp_path: Path) -> None:
    table = read_text_table(
        _write(tmp_path, 'made by X\n"t","a, b"\r\n0,"1"\r\n1,2\r\n\r\n', "utf-8-sig"), skip_lines=1
    )
    assert list(table.cells) == ["t", "a, b"]
    np.testing.assert_array_equal(table.numbers("a, b"), [1.0, 2.0])


def test_numbers_are_read_bit_for_bit(tmp_path: Path) -> None:
    values = [math.pi, 1e-308, -0.1, 1e300]
    table = read_text_table(_write(tmp_path, "a\n" + "\n".join(repr(value) for value in values)))
    assert table.numbers("a").tolist() == values


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,a\n0,1\n1,x2\n", r"line 3, column 'a': 'x2' is no number"),
        ("t,t\n0,1\n", "names a column twice: t"),
        ("t,a\n", "has names of columns and no row"),
        ("", "line 1 has no names"),
        ("t,a\n0,1\n0,1,2\n", "Expected 2 fields in line 3, saw 3"),
    ],
)
def test_faults_name_the_place(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_text_table(_write(tmp_path, text)).numbers("a")


def test_a_file_or_column_that_is_not_there(tmp_path: Path) -> None:
    path = _write(tmp_path, "time,alpha\n0,1\n")
    with pytest.raises(InputError, match="did you mean"):
        read_text_table(tmp_path / "itt.csv")
    with pytest.raises(InputError) as caught:
        read_text_table(path).numbers("alpa")
    assert "did you mean alpha?" in str(caught.value)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="no UTF-8"):
        read_text_table(path)
