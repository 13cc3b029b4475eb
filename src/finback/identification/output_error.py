"""Output error: the coefficients under which the measured alpha and q are most likely, for white noise on both.

Maximum likelihood with the noise covariance estimated (Maine & Iliff 1985, NASA RP 1138; Jategaonkar 2006, chapter 4):
Gauss-Newton steps on all stretches together, from the estimate of the weak form. Each stretch has its own start and,
if asked, biases and a delay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from finback.arrays import FloatArray
from finback.identification.chain import Guess, Linearization
from finback.identification.estimate import Estimate
from finback.identification.gauss_newton import Problem, fitted
from finback.identification.maneuver import Maneuver, linearize, maneuver
from finback.identification.model_form import ModelForm
from finback.identification.nuisance import Nuisances
from finback.identification.stretch import Stretch


def output_error(
    stretches: Sequence[Stretch],
    form: ModelForm,
    start: Estimate,
    *,
    least_noise: FloatArray,
    nuisances: Nuisances,
) -> Estimate:
    """Fit all stretches together.

    Args:
        stretches: the data.
        form: the model's form.
        start: the estimate of the weak form: coefficients and smoothed states.
        least_noise: the least standard deviations of alpha in rad and q in rad/s that are believed, shape (2,).
        nuisances: what is estimated for each stretch beside its start.

    Returns:
        The estimate; its residuals are measured less predicted, whitened by the noise found.

    Raises:
        RefusedError: the data cannot determine every coefficient, or the first estimate is of no use.
    """
    begun = [
        maneuver(*pair)
        for pair in ((s, form, start.coefficients, x) for s, x in zip(stretches, start.states, strict=True))
    ]
    problem = Problem(
        flights=tuple(stretch.flight for stretch in stretches),
        predictions=tuple(_prediction(one, form) for one, _ in begun),
        form=form,
        expected=nuisances,
        least_noise=least_noise,
        correlated=True,
        # The weak form has judged what the data determine, but for biases.
        judged=bool(nuisances.deviations.any()),
        begun_by="the weak form",
    )
    return fitted(problem, start.coefficients, [guess for _, guess in begun])


def _prediction(one: Maneuver, form: ModelForm) -> Callable[[FloatArray, Guess], Linearization]:
    return lambda coefficients, guess: linearize(one, form, coefficients, guess)
