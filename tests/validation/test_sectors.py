"""The survey of sectors: rings agree, and it finds out a sector or a mesh that does not."""

import json

from validation import sectors as survey

RING = (1.3, -1.0)  # a pair of changes within one step
FOUND = [(0.0, 2), (1.5, 1), (1.6, -1)]


def test_a_ring_on_which_all_agree():
    """Natural curvature -1, alpha = beta = 1.3: index 2 when flat; 8, 7, 8 near gamma = 1.83."""
    done = survey.Survey()
    done.add(*RING, (64,))
    assert str(done) == "1 of 1 rings agree"
    (row,) = json.loads(survey.saved(done))["rings"]
    quarter = row["found"]["64"][0]
    assert quarter[0] == [0.0, 2]
    places = {round(gamma, 5): jump for gamma, jump in quarter}
    assert places[1.81974] == -1
    assert places[1.84745] == 1


def test_what_differs_is_named(monkeypatch):
    """The full ring misses a pair on 64 edges, the half puts a change elsewhere on 128."""

    def changes(_alpha, _curvature, sector, n_edges, _options):
        if (sector, n_edges) == ("full", 64):
            return FOUND[:1]
        if (sector, n_edges) == ("half", 128):
            return [*FOUND[:2], (1.6 + 1e-4, -1)]
        return FOUND

    monkeypatch.setattr(survey, "changes", changes)
    done = survey.survey(2, 0)
    ((alpha, curvature), _) = survey.rings(2, 0)
    assert str(done).splitlines()[:2] == [
        "0 of 2 rings agree",
        f"alpha = beta = {alpha!r}, kappa0 = {curvature!r}: full 64, half 128",
    ]


def test_meshes_may_differ(monkeypatch):
    """A pair on 128 edges alone, found by every search there: the mesh, not the search."""
    monkeypatch.setattr(survey, "changes", lambda *ring: FOUND if ring[3] == 128 else FOUND[:1])
    assert str(survey.survey(1, 0)).endswith(": mesh")


def test_changes_in_one_place_are_one():
    """Modes that cross zero together, on two sectors in two orders."""
    assert survey._together([(0.0, 0), (1.0, 1), (1.0 + 1e-9, 1), (2.0, -1)]) == [
        (0.0, 0),
        (1.0 + 1e-9, 2),
        (2.0, -1),
    ]
