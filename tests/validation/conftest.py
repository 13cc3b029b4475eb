"""The published model of the F-8 II as test data, and the aircraft that is built from it."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from finback.dynamics.model import PolynomialModel
from finback.dynamics.polynomial import Polynomial
from finback.flight.aircraft import find_aircraft
from finback.flight.plan import FlightOptions
from finback.flight.rig import Rig
from finback.records import Condition
from finback.store.model_file import read_model_file
from finback.units import to_si
from finback.validation.options import FoldOptions

AIRCRAFT = Path(__file__).parents[2] / "aircraft" / "f8ii"


@pytest.fixture(scope="session")
def paper_model() -> PolynomialModel:
    """The model from which the aircraft is built, exact by definition."""
    return read_model_file(AIRCRAFT / "published.toml").model()


@pytest.fixture(scope="session")
def fitted_model(paper_model: PolynomialModel) -> PolynomialModel:
    """The same coefficients with what a fit adds: a box of data, and standard errors of 0.1 % without correlation."""
    box = np.array([[-0.55, 0.78], [-1.5, 1.5], [-0.7, 0.35]])

    def boxed(polynomial: Polynomial) -> Polynomial:
        return Polynomial(
            variables=polynomial.variables,
            powers=polynomial.powers,
            coefficients=polynomial.coefficients,
            value_unit=polynomial.value_unit,
            domain=box,
        )

    return PolynomialModel(
        alpha_dot=boxed(paper_model.alpha_dot),
        q_dot=boxed(paper_model.q_dot),
        covariance=np.diag((1e-3 * paper_model.coefficients) ** 2),
    )


@pytest.fixture(scope="session")
def condition() -> Condition:
    """The reference flight of the published model."""
    return Condition(airspeed_m_s=295.07, density_kg_m3=0.26548, gravity_m_s2=9.80665, altitude_m=13026.6)


@pytest.fixture(scope="session")
def rig(condition: Condition) -> Iterator[Rig]:
    """The F-8 II on the rig."""
    with Rig(find_aircraft("f8ii", near=AIRCRAFT), condition, step_s=1 / 400) as found:
        yield found


@pytest.fixture(scope="session")
def mirrored_rig(condition: Condition, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """The same aircraft with an elevator that works the other way round."""
    folder = tmp_path_factory.mktemp("mirrored") / "f8ii"
    shutil.copytree(AIRCRAFT, folder)
    path = folder / "f8ii.xml"
    text, count = re.subn(
        r"<property>fcs/elevator-pos-rad</property>(\s*<table)",
        r"<value>-1</value><property>fcs/elevator-pos-rad</property>\1",
        path.read_text(encoding="utf-8"),
    )
    assert count == 2  # in lift and in pitching moment
    path.write_text(text, encoding="utf-8")
    with Rig(find_aircraft(str(path), near=folder), condition, step_s=1 / 400) as found:
        yield found


@pytest.fixture(scope="session")
def flight() -> FlightOptions:
    """Limits of the research range."""
    return FlightOptions(
        alpha_limits_rad=(to_si(-33.0, "deg"), to_si(46.0, "deg")),
        elevator_limits_rad=(to_si(-40.0, "deg"), to_si(20.0, "deg")),
        elevator_rate_rad_s=to_si(60.0, "deg_s"),
    )


@pytest.fixture(scope="session")
def short() -> FoldOptions:
    """Searches short enough for a test; the study's are ten times as long."""
    return FoldOptions(
        ramp_rates_rad_s=tuple(to_si(rate, "deg_s") for rate in (0.02, 0.03, 0.05, 0.1, 0.2)),
        margin_rad=to_si(5.0, "deg"),
        start_offset_rad=to_si(1.0, "deg"),
        hold_s=40.0,
        approach_s=4.0,
        resolution_rad=to_si(0.001, "deg"),
    )
