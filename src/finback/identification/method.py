"""The estimators, by name."""

from __future__ import annotations

from enum import StrEnum
from typing import final


@final
class Method(StrEnum):
    """How coefficients are estimated."""

    WEAK_FORM = "weak-form"
    """generalized least squares on integrals of the equations: fast, needs no integration of the model"""
    OUTPUT_ERROR = "output-error"
    """maximum likelihood of the measured alpha and q: the least variance that noise of the sensors allows"""
    FREQUENCY = "frequency"
    """least squares on finite Fourier transforms of the equations, within a band"""
    FILTER_ERROR = "filter-error"
    """maximum likelihood of the innovations of a Kalman filter: for flight in turbulence"""
