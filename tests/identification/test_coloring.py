"""The correction of a covariance for colored residuals, against the double sum and against repeated fits."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from finback.arrays import FloatArray
from finback.identification.coloring import coloring, whiteness

POLE = 0.9
TRIALS = 400


def _regressors(count: int) -> FloatArray:
    """Columns slow against the color, shape (count, 2, 2): what color harms."""
    time = np.arange(count) / count
    slow = np.stack([np.cos(40 * time), np.sin(25 * time)], axis=1)
    return np.stack([slow, 0.5 * slow[:, ::-1]], axis=1)


def _noise(random: np.random.Generator, count: int) -> FloatArray:
    """First-order colored noise of variance 1 on both channels, shape (count, 2)."""
    white = random.standard_normal((count + 200, 2)) * np.sqrt(1 - POLE**2)
    colored: FloatArray = lfilter([1.0], [1.0, -POLE], white, axis=0)
    return colored[200:]


def test_corrected_errors_are_those_of_repeated_fits() -> None:
    rows = _regressors(800)
    flat = rows.reshape(-1, 2)
    covariance = np.linalg.inv(flat.T @ flat)
    random = np.random.default_rng(0)
    errors, stated = [], []
    for _ in range(TRIALS):
        noise = _noise(random, 800)
        step = covariance @ flat.T @ noise.ravel()
        errors.append(step)
        found = coloring(covariance, [rows], [noise - rows @ step])
        assert found.colored
        stated.append(np.sqrt(np.diag(found.covariance)))
    ratio = np.median(stated, axis=0) / np.std(errors, axis=0)
    # 400 trials tell a deviation to 3.5 %; fits to the data take 10 % off the slowest color of 800 samples.
    assert (np.abs(ratio - 1) < 0.2).all()
    blind = np.sqrt(np.diag(covariance)) / np.std(errors, axis=0)
    assert (blind < 0.35).all()  # (1 - 0.9) / (1 + 0.9) = 0.23² of the variance is what the bound knows of


def test_the_fast_sum_is_the_double_sum() -> None:
    random = np.random.default_rng(1)
    pieces = [120, 60]
    rows = [random.standard_normal((count, 2, 3)) for count in pieces]
    residuals = [np.cumsum(random.standard_normal((count, 2)), axis=0) for count in pieces]
    covariance = np.linalg.inv(sum(piece.reshape(-1, 3).T @ piece.reshape(-1, 3) for piece in rows))
    found = coloring(covariance, rows, residuals)
    reach = 120 // 5
    middle = np.zeros((3, 3))
    for piece in rows:
        for lag in range(-reach, reach + 1):
            mean = sum(
                e[: len(e) - abs(lag)].T @ e[abs(lag) :] for e in residuals if len(e) > abs(lag)
            ) / sum(pieces)  # fmt: skip
            mean = mean if lag >= 0 else mean.T
            for i in range(max(0, -lag), min(len(piece), len(piece) - lag)):
                middle += piece[i].T @ mean @ piece[i + lag]
    expected = np.diag(covariance @ middle @ covariance)
    larger = expected > np.diag(covariance)
    assert larger.any()
    np.testing.assert_allclose(np.diag(found.covariance)[larger], expected[larger], rtol=1e-6)


def test_white_residuals_change_nothing() -> None:
    rows, random = _regressors(800), np.random.default_rng(2)
    flat = rows.reshape(-1, 2)
    covariance = np.linalg.inv(flat.T @ flat)
    results = [coloring(covariance, [rows], [random.standard_normal((800, 2))], widening=2.0) for _ in range(300)]
    # 2 channels at a probability of 1e-3 each: 0.6 of 300 are expected, 5 or more once in 2500.
    assert sum(result.colored for result in results) < 5
    white = next(result for result in results if not result.colored)
    np.testing.assert_array_equal(white.covariance, 2.0 * covariance)
    assert white.factor == 1.0


def test_whiteness_is_a_probability_over_pieces() -> None:
    """Of 1000 white series in three pieces, 50 ± 7 lie below 0.05; four times that is allowed."""
    random = np.random.default_rng(1)
    found = [whiteness(np.split(row, [150, 400])) for row in 3.0 * random.standard_normal((1000, 600))]
    assert abs(np.mean(np.array(found) < 0.05) - 0.05) < 0.028
    assert whiteness(np.split(_noise(random, 600)[:, 0], [150, 400])) < 1e-6
    assert whiteness([random.standard_normal(15), random.standard_normal(15)]) == 1.0
