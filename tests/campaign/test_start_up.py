"""A campaign starts at once: neither its worker nor its owner imports what only other stages need."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = {"numba", "scipy", "pandas", "matplotlib", "rerun", "sympy", "distributed"}


@pytest.mark.parametrize("module", ["finback.flight.campaign.crew", "finback.campaign"])
def test_nothing_heavy_stands_between_start_and_first_flight(module: str) -> None:
    code = f"import sys, {module}; print(' '.join(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not HEAVY & set(done.stdout.split())
