"""Text files of columns: what is read, and what every fault says."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from finback.errors import InputError
from finback.formats.text_table import TextFormat, read_text_table


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
        _write(tmp_path, 'made by X\n"t","a, b"\r\n0,"1"\r\n1,2\r\n\r\n', "utf-8-sig"), TextFormat(skip_lines=1)
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


def test_names_and_units_that_a_logger_wrote_again_are_blank_lines(tmp_path: Path) -> None:
    path = _write(tmp_path, "t,alpha\ns,deg\n0,1\n1,2\nt,alpha\ns,deg\n2,s\n")
    table = read_text_table(path, TextFormat(skip_rows=1))
    np.testing.assert_array_equal(table.numbers("t"), [0.0, 1.0, np.nan, np.nan, 2.0])
    with pytest.raises(InputError, match="line 7, column 'alpha': 's' is no number"):
        table.numbers("alpha")


def test_a_file_or_column_that_is_not_there(tmp_path: Path) -> None:
    path = _write(tmp_path, "time,alpha\n0,1\n")
    with pytest.raises(InputError, match="did you mean"):
        read_text_table(tmp_path / "itt.csv")
    with pytest.raises(InputError) as caught:
        read_text_table(path).numbers("alpa")
    assert "did you mean alpha?" in str(caught.value)
    path.write_bytes(b"t,\xe9\n0,1\n")
    with pytest.raises(InputError, match="no UTF-8"):
        read_text_table(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_encodings(tmp_path: Path, encoding: str) -> None:
    """A mark at the beginning says which; without one it is UTF-8, or what it is said to be."""
    path = _write(tmp_path, "t;größe\n0;1\n", encoding)
    if encoding == "latin-1":
        with pytest.raises(InputError) as caught:
            read_text_table(path)
        assert 'encoding = "latin-1"' in str(caught.value)
        table = read_text_table(path, TextFormat(encoding=encoding))
    else:
        table = read_text_table(path)
    assert table.numbers("größe").tolist() == [1.0]
    with pytest.raises(InputError, match="no encoding is called 'klingon'"):
        read_text_table(path, TextFormat(encoding="klingon"))


@pytest.mark.parametrize(
    ("text", "layout", "values"),
    [
        ("t;a\n0;1,5\n1;-2,5e3\n", TextFormat(decimal=","), [1.5, -2500.0]),
        ("t;a\n0;1.234.567,5\n1;-1.234\n", TextFormat(decimal=",", thousands="."), [1234567.5, -1234.0]),
        ('t,a\n0,"1,234.5"\n1,7\n', TextFormat(thousands=","), [1234.5, 7.0]),
        ("t,a\ns,deg\n0,1\n1,2\n", TextFormat(skip_rows=1), [1.0, 2.0]),
        ("t   a\n0 \t 1\n  1    2 \n", TextFormat(), [1.0, 2.0]),
        ("note\n t a\n 0 1\n", TextFormat(skip_lines=1), [1.0]),
        ("t,a\n0,1.5D+03\n1,-2d-1\n", TextFormat(), [1500.0, -0.2]),
    ],
)
def test_layouts(tmp_path: Path, text: str, layout: TextFormat, values: list[float]) -> None:
    assert read_text_table(_write(tmp_path, text), layout).numbers("a").tolist() == values


@pytest.mark.parametrize(
    ("text", "layout", "said"),
    [
        ("t;a\n0;1,5\n", TextFormat(), "decimal = ','"),
        ("t;a\n0;1.234.567\n", TextFormat(), 'thousands = "."'),
        ('t,a\n0,"1,234.5"\n', TextFormat(), 'thousands = ","'),
        ("t,a\ns,deg\n0,1\n", TextFormat(), "skip_rows = 1"),
        ("t;a\n0;1.5\n", TextFormat(decimal=","), "'1.5' is no number"),
        ('t,a\n0,"1,23"\n', TextFormat(thousands=","), "'1,23' is no number"),
        ("t,a\ns,deg\n0,x\n", TextFormat(skip_rows=1), "line 3, column 'a'"),
    ],
)
def test_what_is_no_number_is_not_guessed(tmp_path: Path, text: str, layout: TextFormat, said: str) -> None:
    """A group of two digits is no group, and a point no comma: a wrong number is worse than none."""
    with pytest.raises(InputError) as caught:
        read_text_table(_write(tmp_path, text), layout).numbers("a")
    assert said in str(caught.value)
