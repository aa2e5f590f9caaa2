"""How much the benchmark measures: everything, or a quick selection."""

from __future__ import annotations

from dataclasses import dataclass

from validation.benchmark.rings import RINGS, BenchRing


@dataclass(frozen=True)
class Extent:
    """How much is measured; the defaults are the complete benchmark."""

    repeats: int = 5
    slow_repeats: int = 3  # of methods that take seconds
    rings: tuple[BenchRing, ...] = RINGS
    states: int = 400  # of the reference, over 0 to pi; 256 are enough for 1e-9
    edges: tuple[int, ...] = (16, 32, 64, 128, 256, 512, 1024)
    tolerances: tuple[float, ...] = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
    relaxed: tuple[int, ...] = (32, 64, 128)
    stepping: tuple[float, ...] = (1e-3, 1e-5, 1e-6)  # tolerances of scipy's solver
    elements: tuple[int, ...] = (16, 32, 64, 128, 256)  # of PyElastica
    orders: tuple[int, ...] = (32, 64, 128, 256, 512)
    scales: tuple[int, ...] = (16, 64, 256, 1024, 4096, 16384, 65536)
    swept: int = 1000
    sample: int = 40
    commands: int = 5
    cold: bool = True  # also measure the time of compiling


FULL = Extent()
QUICK = Extent(
    repeats=3,
    slow_repeats=1,
    rings=tuple(case for case in RINGS if case.name != "rectangle 0.6, r/a 0.3"),
    edges=(32, 128),
    tolerances=(1e-4, 1e-7, 1e-10),
    relaxed=(32,),
    stepping=(1e-3,),
    elements=(16, 32),
    orders=(64, 128, 256),
    scales=(64, 1024, 16384),
    swept=50,
    sample=4,
    commands=2,
    cold=False,
)
