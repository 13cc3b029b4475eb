"""What the user of an identification chooses."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final, final

from finback.errors import InputError
from finback.identification.method import Method
from finback.identification.model_form import ModelForm
from finback.identification.nuisance import Nuisances
from finback.identification.selection.options import SelectionOptions

HIGHEST_ORDER: Final = 9
"""Above this power of alpha, double precision and 0.1 deg of noise leave nothing to identify."""


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class IdentificationOptions:
    """Model form, window and test functions of one identification.

    Attributes:
        alpha_window_rad: lowest and highest alpha of the samples used; a record is used up to its first exit.
        alpha_order: highest power of alpha in dα/dt and in dq/dt, each >= 1.
        half_width_s: half width of the test functions in s, > 0; long against the sample interval, short against
            the slowest maneuver. 0.2 s suits a short period of 2 s at 100 Hz.
        spacing_s: time between the centers of neighboring test functions in s, > 0 and <= half_width_s.
        minimum_duration_s: shorter stretches of a record are not used, in s; at least two half widths are needed.
        form: one form, which then stands instead of ``alpha_order``; or empty.
        method: the estimator.
        band_1_s: lowest and highest frequency of the frequency domain, in Hz, > 0.
        nuisances: biases and a delay of each flight, estimated with the coefficients, by every method.
        constants_per_flight: whether the constants of dα/dt and dq/dt are estimated for each flight of its own; the
            model then has their mean.
        selection: one library from which the form is selected, instead of ``alpha_order`` and ``form``; or empty.
    """

    alpha_window_rad: tuple[float, float]
    alpha_order: tuple[int, int] = (3, 3)
    half_width_s: float = 0.2
    spacing_s: float = 0.05
    minimum_duration_s: float = 1.0
    form: tuple[ModelForm, ...] = ()
    method: Method = Method.WEAK_FORM
    band_1_s: tuple[float, float] = (0.05, 2.0)
    nuisances: Nuisances = field(default_factory=Nuisances)
    selection: tuple[SelectionOptions, ...] = ()
    constants_per_flight: bool = False

    def __post_init__(self) -> None:
        """Check every value."""
        low, high = self.alpha_window_rad
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError(f"alpha_window_rad is ({low}, {high}), expected (low, high) with low < high")
        for order in self.alpha_order:
            if not 1 <= order <= HIGHEST_ORDER:
                raise InputError(f"alpha_order is {self.alpha_order}, expected two numbers in 1..{HIGHEST_ORDER}")
        if not 0 < self.half_width_s < math.inf:
            raise InputError(f"half_width_s is {self.half_width_s}, expected a time > 0")
        if not 0 < self.spacing_s <= self.half_width_s:
            raise InputError(
                f"spacing_s is {self.spacing_s}, expected > 0 and at most half_width_s ({self.half_width_s})",
                hint="a quarter of half_width_s is enough",
            )
        if not 0 <= self.minimum_duration_s < math.inf:
            raise InputError(f"minimum_duration_s is {self.minimum_duration_s}, expected a time >= 0")
        if len(self.form) > 1:
            raise InputError(f"{len(self.form)} forms were given, expected one at most")
        if len(self.selection) > 1 or (self.selection and self.form):
            raise InputError("give one form, or one library to select it from, not more")
        if self.constants_per_flight and any(asked.prediction for asked in self.selection):
            raise InputError(
                "flights that are kept out of a selection have constants that nothing fits (constants_per_flight)",
                hint="leave prediction out, or select from flights at one trim",
            )

    @property
    def model_form(self) -> ModelForm:
        """The form that is fitted: the one given, or polynomials of ``alpha_order``."""
        return self.form[0] if self.form else ModelForm.polynomial(self.alpha_order)
