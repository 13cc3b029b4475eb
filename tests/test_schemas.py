"""A stored file whose content changes gets another version: files of the last one are refused, not called damaged."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from enum import Enum
from typing import get_args, get_type_hints

import pytest

from finback.dynamics.analysis import Analysis
from finback.dynamics.planar.analysis import PlanarAnalysis
from finback.identification.coefficient.identify import CoefficientIdentification
from finback.identification.identify import Identification
from finback.store.campaign import CampaignHeader
from finback.store.coefficients import COEFFICIENTS
from finback.store.envelope import ANALYZE, ANALYZE_PLANAR, CAMPAIGN, IDENTIFY, VALIDATE, Stage
from finback.validation.validate import Validation

# Version of each stored content and the beginning of the SHA-256 of its keys. Whoever changes the keys raises the
# stage's version and writes the new line; a line is rewritten only while no release has its version.
KNOWN = {
    "finback/model/2": "a4c231fbf8c7",
    "finback/analysis/3": "b2b90873f82b",
    "finback/planar-analysis/3": "a88ffe8d8762",
    "finback/validation/1": "cf432a74539a",
    "finback/coefficients/2": "0f79f03c3582",
    "finback/campaign/1": "91e3a43e7cac",
}
STORED = (
    (IDENTIFY, Identification),
    (ANALYZE, Analysis),
    (ANALYZE_PLANAR, PlanarAnalysis),
    (VALIDATE, Validation),
    (COEFFICIENTS, CoefficientIdentification),
    (CAMPAIGN, CampaignHeader),
)


def keys_of(kind: object, found: dict[str, list[str]]) -> dict[str, list[str]]:
    """Return the keys of every class that stands in a content, and the words of every enumeration."""
    name = getattr(kind, "__qualname__", "")
    if isinstance(kind, type) and dataclasses.is_dataclass(kind) and name not in found:
        found[name] = sorted(field.name for field in dataclasses.fields(kind))
        for part in get_type_hints(kind).values():
            keys_of(part, found)
    elif isinstance(kind, type) and issubclass(kind, Enum):
        found[name] = sorted(str(member.value) for member in kind)
    for part in get_args(kind):
        keys_of(part, found)
    return found


@pytest.mark.parametrize(("stage", "kind"), STORED, ids=[stage.kind for stage, _ in STORED])
def test_other_keys_are_another_version(stage: Stage, kind: type) -> None:
    keys = json.dumps(keys_of(kind, {}), sort_keys=True)
    shape = hashlib.sha256(keys.encode()).hexdigest()[:12]
    assert KNOWN.get(stage.schema) == shape, f"{stage.schema} has other keys: raise its version, and write {shape} here"
