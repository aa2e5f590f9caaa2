"""Pictures, movies, pages and recordings of records.

May import records, geometry and utils; never a solver.
Begin with plots/path.py.
"""
