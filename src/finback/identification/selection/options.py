"""What the user of a selection chooses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from finback.errors import InputError
from finback.identification.model_form import ModelForm


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class SelectionOptions:
    """Candidates, and how sure one must be of them.

    Attributes:
        library: the candidates of both equations, none fixed or bounded.
        false_alarm: chance that noise alone brings any term into the model, in 0…0.5.
        bootstraps: how often the selection is repeated on resampled data; 0 for never.
        prediction: flights that are kept out of the selection and predicted by it; by name. They decide only between
            structures that explain the others equally.
        seed: of the resampling.
    """

    library: ModelForm
    false_alarm: float = 0.01
    bootstraps: int = 50
    prediction: tuple[str, ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        """Check every value."""
        if not 0 < self.false_alarm <= 0.5:
            raise InputError(f"false_alarm is {self.false_alarm}, expected a chance in 0…0.5")
        if not 0 <= self.bootstraps <= 10_000:
            raise InputError(f"bootstraps is {self.bootstraps}, expected 0…10000")
        if self.library.fixed or self.library.bounded:
            raise InputError("a library of candidates has no fixed or bounded coefficients")
