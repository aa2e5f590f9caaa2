"""Pictures, motions and playbacks of records.

May import records, geometry and utils; never a solver.
Begin with plots/path.py.
"""
