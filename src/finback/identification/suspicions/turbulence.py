"""Was the air calm? Gusts move alpha as nothing else does: broadly in frequency, and the aircraft answers."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.special import chdtrc

from finback.identification.suspicions.finding import Suspect, Suspicion, unjudged
from finback.identification.suspicions.fluctuation import Fluctuation, Likelihood, likelihood
from finback.identification.suspicions.motion import motion
from finback.identification.suspicions.residuals import OF_SLOW, Residuals
from finback.identification.whitening import Whitening, whitening
from finback.units import from_si

_SIGNIFICANT: Final = 1e-3
_EXCESS: Final = 0.1
"""Of the mean square residual of dα/dt over 1, from which it is more than the sensors' noise."""
_FEWEST: Final = 20  # equations that nothing has been fitted to: the mean square of fewer is not known to a third
_UNCERTAIN: Final = 2.5  # standard errors of the sensors' noise by which it must be more, besides
_LEAD: Final = 20.0
"""Twice a log-likelihood by which one cause must lead another: for normal noise a chance of 1e-5; the rest is for
what a model misses, which is no noise."""
_AIR_LEADS, _SENSOR_LEADS = 0.05, 0.1
"""Of what gusts explain at all: by this much gusts must lead noise of the sensor, and it them, too. Colored noise on
both sensors describes the answer to large gusts fairly well, so that it needs the longer lead."""
_OF_MOTION: Final = 0.015
"""Of alpha's motion: a model is hardly ever right to less, and what it misses is then no sign of gusts."""
_OF_PITCHING: Final = 0.5
"""Of the excess in dq/dt: gusts disturb alpha, and q only through it; a worse dq/dt has another cause."""
_NO_LIKELIHOOD: Final = "no noise of any size makes alpha and q as they are likely: what the model misses hides gusts"
_SPEED_SAYS: Final = "what is left of dα/dt may be what an airspeed does that is not recorded"


def turbulence(found: Residuals, left: Residuals) -> Suspicion:
    """Judge the residuals that are left when a calm flight has explained what it may.

    If they are larger than the white noise of the sensors, three causes compete: what the model misses, which grows
    with the motion; colored noise of the sensors; and gusts. Both of the last move alpha as it is measured; only to
    gusts do lift and moment answer, which q shows.

    Args:
        found: the residuals of the fit.
        left: those of them that are left.
    """
    excess = left.excess
    count = 0.5 * (left.values.size - left.basis.shape[1])
    if count < _FEWEST:
        return unjudged(Suspect.TURBULENCE, f"{max(0, int(count))} equations are too few to see gusts in")
    chance = float(chdtrc(count, count * excess[0]))
    noise = 1.0 + _EXCESS + _UNCERTAIN * found.uncertainty
    beyond = chance < _SIGNIFICANT and excess[0] > noise
    calm = f"alpha moves as the model says, but for {np.sqrt(excess[0]):.2g} times the sensors' noise: calm air"
    # What a calm flight may hold explains much of slow gusts, too, where there is little else to explain.
    if not beyond and found.excess.max() <= noise:
        return _finding(raised=False, probability=chance, size=0.0, statement=calm)
    slow = _of_airspeed(found, left)
    if beyond and slow:
        return unjudged(Suspect.TURBULENCE, _SPEED_SAYS)
    causes = _causes(found, left)
    if not all(np.isfinite(cause.cost) for cause in causes):
        return unjudged(Suspect.TURBULENCE, _NO_LIKELIHOOD)
    if not beyond and causes[0].cost - causes[2].cost < _LEAD:
        return _finding(raised=False, probability=chance, size=0.0, statement=calm)
    return unjudged(Suspect.TURBULENCE, _SPEED_SAYS) if slow else _weighed(found, left, causes)


def _of_airspeed(found: Residuals, left: Residuals) -> bool:
    """Return whether what is left is so much less than slow changes explain that a lacking airspeed may leave it."""
    mine = float(left.excess[0])
    return not found.speed_known and mine - 1.0 < OF_SLOW * (float(found.excess[0]) - mine)


def _weighed(found: Residuals, left: Residuals, causes: tuple[Likelihood, Likelihood, Likelihood]) -> Suspicion:
    """Weigh the causes of residuals that are larger than the sensors' noise by their likelihoods."""
    excess = left.excess
    nothing, sensor, air = causes
    gain, lead = nothing.cost - air.cost, sensor.cost - air.cost
    size = air.deviation_rad / float(found.noise[0])
    degrees = f"{from_si(air.deviation_rad, 'deg'):.2g} deg"
    if size * float(found.noise[0]) < _OF_MOTION * _motion(found) or gain < _LEAD:
        said = "the residuals are larger than the sensors' noise, as what a model misses makes them; no sign of gusts"
        return _finding(raised=False, probability=1.0, size=size, statement=said)
    if excess[0] - 1.0 < _OF_PITCHING * (excess[1] - 1.0):
        said = "dq/dt is explained even worse than dα/dt: gusts cannot be told from what is wrong there"
        return unjudged(Suspect.TURBULENCE, said)
    if lead > max(_LEAD, _AIR_LEADS * gain):
        said = (
            f"alpha fluctuates by {degrees} that nothing in the record explains, and the aircraft answers: the air was "
            "not calm; estimates are biased as if the controls had moved it"
        )
        return _finding(raised=True, probability=float(chdtrc(1.0, lead)), size=size, statement=said)
    if -lead > max(_LEAD, _SENSOR_LEADS * gain):
        said = (
            f"alpha fluctuates by {degrees}, and the aircraft does not answer: its sensor has colored noise; calm air"
        )
        return _finding(raised=False, probability=1.0, size=0.0, statement=said)
    said = f"alpha fluctuates by {degrees}: whether the aircraft answers, as to gusts, q does not tell"
    return unjudged(Suspect.TURBULENCE, said)


def _motion(found: Residuals) -> float:
    """Return the standard deviation of alpha about the mean of each stretch, in rad."""
    return float(np.std(np.concatenate([state[:, 0] - state[:, 0].mean() for state in found.states])))


def _causes(found: Residuals, left: Residuals) -> tuple[Likelihood, Likelihood, Likelihood]:
    """Return how likely no fluctuation, one of the sensor and one of the air are.

    Coefficients fitted as if alpha's fluctuation were noise are wrong if the aircraft felt it, and the reverse. So each
    cause is given the coefficients of both fits, and judged by its better one.
    """
    noise_as_seen = found.noise * np.sqrt(np.maximum(left.excess, 1.0))
    unfelt = motion(found, whitening(found.forms, found.sides, noise_as_seen))
    felt = motion(found, _in_gusts(found, left))
    return (
        min((likelihood(one, Fluctuation.NONE) for one in (unfelt, felt)), key=_cost),
        min((likelihood(one, Fluctuation.SENSOR) for one in (unfelt, felt)), key=_cost),
        min((likelihood(one, Fluctuation.AIR) for one in (unfelt, felt)), key=_cost),
    )


def _in_gusts(found: Residuals, left: Residuals) -> Whitening:
    """Return what makes the noise white if gusts explain what the residuals of dα/dt are larger than noise."""
    alpha, q = np.maximum(left.excess, 1.0)
    weak = found.forms[0]
    # White noise on dα/dt of density g gives g ∫w² to an equation, sensor noise σ gives σ² Σ(w' interval)².
    sensor = float(found.noise[0]) ** 2 * float(np.sum(weak.bump.slope**2))
    gusts = (alpha - 1.0) * sensor * weak.stretch.interval_s / float(np.sum(weak.bump.value**2))
    return whitening(
        found.forms, found.sides, found.noise * np.array([1.0, np.sqrt(q)]), process=np.array([gusts, 0.0])
    )


def _cost(item: Likelihood) -> float:
    return item.cost


def _finding(*, raised: bool, probability: float, size: float, statement: str) -> Suspicion:
    return Suspicion(
        suspect=Suspect.TURBULENCE, judged=True, raised=raised, probability=probability, size=size, statement=statement
    )
