"""Cases of phase diagrams without mechanics, for workers that need no kernels to solve them.

Worker processes import this module by its name. It loads no numba, so that a worker starts in a
third of a second instead of two seconds.
"""

import math
import os
import random
import signal
import time
from dataclasses import replace

from der.diagram.cases import LABELS, Row
from der.diagram.curves.asking import call
from der.diagram.families import family

NOTES = "RING_ORIGAMI_NOTES"  # as in validation.stress.kill_and_resume, whose import is slow
TOY = replace(family("fig3a", finest=16), coarse=4)
CUBE = replace(family("fig8a", finest=4), coarse=4)
POISON = TOY.case("x", (0.5, 0.5))


def toy(case):
    """A disc of one label in a plane of another."""
    inside = math.hypot(case.b_over_a - 0.7, (case.h_over_t - 2.0) / 7.6) < 0.13
    label = "stable at fixed moment, snap-through" if inside else "unfoldable"
    return Row(case, label, inside, inside, moment=0.0, slope=1.0, seconds=random.random())


def toy_with_notes(case):
    """`toy`, which leaves a line for every case that it was given."""
    with open(os.environ[NOTES], "a") as file:
        file.write(f"{case.key}\n")
    return toy(case)


def toy_that_dies_once(case):
    """`toy`, but the first worker to come here is killed."""
    if abs(case.h_over_t - 2.0) < 0.3:
        die_once()
    return toy(case)


def toy_with_poison(case):
    """`toy`, but one case kills every worker."""
    return deadly(case) if case == POISON else toy(case)


def slow(case):
    """A toy that takes long enough to be met in the middle."""
    time.sleep(0.01)
    return toy_with_notes(case)


def deadly(case):
    """Kill the worker."""
    os.kill(os.getpid(), signal.SIGKILL)


def die_once():
    """Kill the worker, unless one was killed before."""
    try:
        os.close(os.open(os.environ[NOTES], os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return
    os.kill(os.getpid(), signal.SIGKILL)


def wedge(case):
    """Foldable from h/t = 2.2 on."""
    folds = case.h_over_t > 2.2
    label = LABELS[3] if folds else LABELS[0]
    return Row(case, label, folds, folds, "snap-through", moment=0.0, slope=1.0)


def along(part, work=None):
    """In place of the search in a slice: a row, and one point of a curve, made by a worker."""
    yield [part.case((0.6, 0.7))]
    return (yield from call(work or one_point, part.bare))


def one_point(part):
    """A curve with one point."""
    from der.diagram.curves.slices import Boundaries
    from der.diagram.scanned_boundaries import BoundaryPoint, Curve

    point = BoundaryPoint(part.case((0.6, 0.6)), math.pi, 0.0, 0.0)
    return Boundaries([Curve("foldability", "x", (point,))], [])


def along_that_dies_once(part):
    """`along`, but the first worker to come to the middle is killed."""
    return along(part, one_point_after_a_death if part.plane == 0.5 else None)


def one_point_after_a_death(part):
    """`one_point`, but the first worker to come here is killed."""
    die_once()
    return one_point(part)


def along_with_poison(part):
    """`along`, but the slice in the middle kills every worker."""
    return along(part, deadly if part.plane == 0.5 else None)
