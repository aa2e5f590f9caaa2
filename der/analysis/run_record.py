"""The entries of a record that tell of the ring and of the run."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from der.records.record import SolveTime
from der.scene import Scene
from der.utils.run import Run


def run_entries(scene: Scene, run: Run) -> dict[str, Any]:
    """Return the entries of a record that tell of the ring and of the run."""
    ended = {"status": run.status, "message": run.message, "timing": SolveTime(run.seconds)}
    ring = {"ring": scene.ring.to_json(), "section": asdict(scene.section), "scale": scene.scale}
    return ended | ring
