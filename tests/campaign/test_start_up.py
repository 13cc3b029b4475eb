"""A campaign starts at once: neither its worker nor its owner imports what only other stages need."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = {"numba", "scipy", "pandas", "matplotlib", "rerun", "sympy", "distributed"}


WORKER = "finback.flight.campaign.crew"
OWNER = "finback.campaign, finback.cli.application, finback.cli.progress, finback.cli.campaign_result"


@pytest.mark.parametrize("modules", [WORKER, OWNER])
def test_nothing_heavy_stands_between_start_and_first_flight(modules: str) -> None:
    code = f"import sys, {modules}; print(' '.join(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not HEAVY & set(done.stdout.split())
