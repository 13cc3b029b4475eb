"""The F-8 II of Shi & Fan (2013), section 5: its numbers by 130-bit computation, here from the printed coefficients."""

from __future__ import annotations

import numpy as np
import pytest

from finback.dynamics.branch import branch
from finback.dynamics.equilibrium import Kind, equilibria
from finback.dynamics.fold import folds
from finback.dynamics.lienard import LienardSystem
from finback.units import from_si, to_si

PRINTED = 6e-10  # deg, 1/s: the reference values are given to ten decimals or nine
# elevator; left saddle, sink, right saddle (deg); eigenvalues of the sink (1/s).
TABLE = (
    (10.0, (-19.9979469048, -6.2546245939, 43.0919346755), (-0.503277404, 2.302841483)),
    (5.0, (-22.6197208933, -2.6957964483, 42.1548805183), (-0.571388029, 2.644765032)),
    (0.0, (-24.5533582793, 0.2463369416, 41.1463845145), (-0.608084797, 2.817880763)),
    (-5.0, (-26.1412513568, 2.9306546844, 40.0499598491), (-0.626080070, 2.906770423)),
    (-10.0, (-27.5120404108, 5.5096108358, 38.8417927517), (-0.629451390, 2.936269602)),
    (-30.0, (-31.7923055025, 17.1505445732, 31.4811241060), (-0.474942560, 2.349643082)),
)


@pytest.mark.parametrize(("elevator_deg", "alphas_deg", "eigenvalue"), TABLE)
def test_equilibria_and_eigenvalues(
    printed_system: LienardSystem,
    elevator_deg: float,
    alphas_deg: tuple[float, float, float],
    eigenvalue: tuple[float, float],
) -> None:
    found = equilibria(printed_system, to_si(elevator_deg, "deg"))
    assert [point.kind for point in found] == [Kind.SADDLE, Kind.STABLE_FOCUS, Kind.SADDLE]
    np.testing.assert_allclose([from_si(p.alpha_rad, "deg") for p in found], alphas_deg, rtol=0, atol=1e-10)
    assert found[1].eigenvalues_real_1_s[0] == pytest.approx(eigenvalue[0], abs=PRINTED)
    assert found[1].eigenvalues_imag_1_s[0] == pytest.approx(eigenvalue[1], abs=PRINTED)


def test_saddle_eigenvalues_without_elevator(printed_system: LienardSystem) -> None:
    left, _, right = equilibria(printed_system, 0.0)
    np.testing.assert_allclose(left.eigenvalues_real_1_s, (3.919704449, -3.405642128), rtol=0, atol=PRINTED)
    np.testing.assert_allclose(right.eigenvalues_real_1_s, (5.467397774, -4.026698651), rtol=0, atol=PRINTED)


def test_folds(printed_system: LienardSystem) -> None:
    found = folds(printed_system)
    np.testing.assert_allclose(
        [from_si(f.elevator_rad, "deg") for f in found], (14.7252153801, -35.1293238979), rtol=0, atol=1e-10
    )
    np.testing.assert_allclose(
        [from_si(f.alpha_rad, "deg") for f in found], (-13.5416505800, 24.7678926978), rtol=0, atol=1e-10
    )


def test_the_trace_of_the_sink_over_the_elevator(printed_system: LienardSystem) -> None:
    """a0 of Eq. (38) between the folds: least at alpha 4.857604, elevator −8.728019 deg, greatest at the lower fold."""
    left, right = (fold.alpha_rad for fold in folds(printed_system))
    found = branch(printed_system, np.linspace(left, right, 4001))
    assert found.divergence_1_s[0] == pytest.approx(-0.56555687, abs=6e-9)
    assert found.divergence_1_s[-1] == pytest.approx(-0.44684986, abs=6e-9)
    assert found.divergence_1_s.max() == found.divergence_1_s[-1]
    (lowest,) = np.roots(printed_system.damping.derivative("alpha_rad").ascending[::-1])
    assert from_si(lowest, "deg") == pytest.approx(4.857604, abs=6e-7)
    assert from_si(float(printed_system.holding_elevator(lowest)), "deg") == pytest.approx(-8.728019, abs=6e-7)
    least = float(printed_system.damping(lowest))
    assert least == pytest.approx(-1.25977454, abs=6e-9)
    assert least <= found.divergence_1_s.min()


def test_the_sink_is_a_focus_but_beside_the_folds(printed_system: LienardSystem) -> None:
    """A node only above elevator 14.7244434 and below −35.1290254 deg."""
    for elevator_deg, kind in (
        (14.7244433, Kind.STABLE_FOCUS),
        (14.7244435, Kind.STABLE_NODE),
        (-35.1290253, Kind.STABLE_FOCUS),
        (-35.1290255, Kind.STABLE_NODE),
    ):
        assert equilibria(printed_system, to_si(elevator_deg, "deg"))[1].kind is kind
