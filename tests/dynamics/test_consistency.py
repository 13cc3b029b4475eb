"""The checker finds nothing in diagrams as they are, and what is wrong in those that were spoiled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from finback.dynamics.consistency import inconsistencies, inconsistencies_of_flow, inconsistencies_of_located
from finback.dynamics.diagram.curve import CurveKind, Diagram, DiagramCurve, DiagramOptions, PointKind
from finback.dynamics.diagram.diagram import diagram, natural_mu_range
from finback.dynamics.located import Bracket, Estimate, Located, Parameter
from finback.dynamics.normal_form.cubic import Cubic


def _diagram(a1: float, b1: float, b2: float, span: tuple[float, float] | None, nodes: int = 7) -> Diagram:
    family = Cubic(a1=a1, b1=b1, b2=b2, a0=0.0, b0=0.0).family()
    return diagram(family, span or natural_mu_range(family), options=DiagramOptions(nodes=nodes))


@pytest.fixture(scope="module")
def sound() -> Diagram:
    return _diagram(0.5, 0.5, 1.0, (-1.0, 0.1), nodes=13)


def test_nothing_is_wrong_with_a_sound_diagram(sound: Diagram) -> None:
    assert inconsistencies(sound) == ()


@settings(max_examples=3, deadline=None, derandomize=True)
@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.integers(0, 1000))
def test_between_saddles_nothing_is_wrong(a1: float, b1: float, seed: int) -> None:
    assert inconsistencies(_diagram(a1, b1, 1.0, None), verticals=2, segments=3, seed=seed) == ()


@settings(max_examples=1, deadline=None, derandomize=True)
@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.integers(0, 1000))
def test_in_wells_nothing_is_wrong(a1: float, b1: float, seed: int) -> None:
    assert inconsistencies(_diagram(a1, b1, -1.0, (0.6, 1.0), nodes=5), verticals=1, segments=2, seed=seed) == ()


@pytest.mark.slow
@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.sampled_from((-1.0, 1.0)), st.integers(0, 1000))
def test_nothing_is_wrong_anywhere(a1: float, b1: float, b2: float, seed: int) -> None:
    assert inconsistencies(_diagram(a1, b1, b2, None), seed=seed) == ()


@pytest.mark.parametrize("b2", [1.0, -1.0])
def test_symmetric_families(b2: float) -> None:
    assert inconsistencies(_diagram(0.0, 0.0, b2, (-0.3, 0.3), nodes=5), verticals=1, segments=0) == ()


# what is wrong is found


def _without(found: Diagram, name: str) -> Diagram:
    return replace(found, curves=tuple(curve for curve in found.curves if curve.name != name))


def _moved(found: Diagram, name: str, share: float) -> Diagram:
    """Return a diagram with one curve moved in λ, and the points on it left where they are."""
    height = float(np.ptp(found.lam_range))

    def move(curve: DiagramCurve) -> DiagramCurve:
        return replace(curve, lam=curve.lam + share * height) if curve.name == name else curve

    return replace(found, curves=tuple(map(move, found.curves)))


_BOUNDING = ("hopf 1, strip 0", "homoclinic 2 left, strip 0", "cycle-fold around 1, strip 0")


@pytest.mark.parametrize("name", _BOUNDING)
def test_a_curve_that_is_missing_is_missed_by_the_numbers(sound: Diagram, name: str) -> None:
    found = inconsistencies(_without(sound, name), verticals=4, segments=0)
    assert any("cycles around (1,)" in line or "no Hopf curve" in line for line in found)
    # A point names it, too.
    assert any(f"meets {name!r}" in line for line in found)


@pytest.mark.parametrize("name", _BOUNDING)
@pytest.mark.parametrize("share", [-0.04, 0.04])
def test_a_curve_that_is_elsewhere_is_found(sound: Diagram, name: str, share: float) -> None:
    found = inconsistencies(_moved(sound, name, share), verticals=4, segments=0)
    assert any("between" in line or "no trace is zero" in line for line in found)
    assert any("ends at" in line or "does not lie on" in line for line in found)


def test_segments_alone_find_a_missing_curve(sound: Diagram) -> None:
    """The homoclinic curve bounds the largest region with a cycle; twenty segments are enough to cross it."""
    spoiled = _without(sound, "homoclinic 2 left, strip 0")
    assert any("the curves crossed say" in line for line in inconsistencies(spoiled, verticals=0, segments=20))
    assert not any("the curves crossed say" in line for line in inconsistencies(sound, verticals=0, segments=20))


def test_a_wrong_stability_is_found(sound: Diagram) -> None:
    """Births of stable and unstable cycles exchanged on the homoclinic curve."""

    def swap(curve: DiagramCurve) -> DiagramCurve:
        return replace(curve, change=-curve.change[:, ::-1]) if curve.kind is CurveKind.HOMOCLINIC else curve

    found = inconsistencies(replace(sound, curves=tuple(map(swap, sound.curves))), verticals=4, segments=0)
    assert any("the curves crossed say" in line for line in found)


_SPOILED: dict[str, tuple[Callable[[Diagram], Diagram], str]] = {
    "a line without its name": (lambda d: _without(d, "transcritical line 1"), "where no line is"),
    "a name twice": (lambda d: replace(d, curves=(*d.curves, d.curves[0])), "stands for more than one thing"),
    "a point outside its bracket": (
        lambda d: replace(d, points=tuple(replace(p, mu=p.mu + 0.01) for p in d.points)),
        "is not in its bracket",
    ),
    "a wide bracket": (
        lambda d: replace(d, points=tuple(replace(p, bracket=p.bracket + np.array([-0.1, 0.1])) for p in d.points)),
        "is wide",
    ),
    "an end without a name": (
        lambda d: replace(d, curves=tuple(replace(c, ends=("nowhere", c.ends[1])) for c in d.curves)),
        "which is not 'nowhere'",
    ),
    "a false count of equilibria": (
        lambda d: replace(d, cells=tuple(replace(cell, saddles=(True,)) for cell in d.cells)),
        "other equilibria",
    ),
}


@pytest.mark.parametrize("what", _SPOILED)
def test_other_faults_are_found(sound: Diagram, what: str) -> None:
    spoil, words = _SPOILED[what]
    assert any(words in line for line in inconsistencies(spoil(sound), verticals=1, segments=0))


def test_flows_are_consistent() -> None:
    for b2, b0, a0 in ((1.0, -0.35, 0.0022), (-1.0, 1.0, 0.765)):
        small = 0.5 if b2 > 0.0 else 0.3
        cubic = Cubic(a1=small, b1=0.5 if b2 > 0.0 else 0.2, a0=a0, b2=b2, b0=b0)
        assert inconsistencies_of_flow(cubic.flow()) == ()


def _located(value: float, bracket: tuple[float, float], interval: tuple[float, float]) -> Located:
    return Located(
        kind="fold",
        parameter=Parameter(name="elevator", value=value, unit="rad", interval=np.array(interval)),
        state={"alpha": Estimate(value=0.1, unit="rad", interval=np.array([0.0, 0.2]))},
        properties={},
        words={},
        residual={},
        brackets=(Bracket(name="elevator", unit="rad", low=bracket[0], high=bracket[1]),),
        in_domain=True,
    )


def test_located_objects() -> None:
    assert inconsistencies_of_located([_located(0.5, (0.4, 0.6), (0.3, 0.7))]) == ()
    wrong = inconsistencies_of_located([_located(0.8, (0.4, 0.6), (0.3, 0.7)), _located(np.nan, (0, 1), (0, 1))])
    assert any("is not in [" in line for line in wrong)
    assert any("is not in its interval" in line for line in wrong)
    assert any("not finite" in line for line in wrong)


def test_a_diagram_says_what_it_does_not_know() -> None:
    """Far into two wells of very unequal size orbits cannot be followed to the loops: a note, and no false end."""
    found = _diagram(1.346, -0.565, -1.0, (-0.03, -0.02), nodes=5)
    for curve in found.curves:
        assert "unresolved" not in curve.ends or found.notes
    assert all(point.kind in PointKind for point in found.points)
