"""Settings that every test shares."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# Neither a deadline nor a check of speed: two cores of a shared machine are no clock.
settings.register_profile("coarsen", deadline=None, suppress_health_check=[HealthCheck.too_slow], print_blob=True)
settings.load_profile("coarsen")

MESHES = Path(os.environ.get("COARSEN_MESHES", Path(__file__).parents[2] / "shared" / "meshes"))
"""The folder of real meshes; it is no part of the project and may be absent."""


@pytest.fixture(scope="session")
def meshes() -> Path:
    """Return the folder of real meshes, or skip where it is absent."""
    if not MESHES.is_dir():
        pytest.skip(f"no real meshes in {MESHES}: set COARSEN_MESHES")
    return MESHES
