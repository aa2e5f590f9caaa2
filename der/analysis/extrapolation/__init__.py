"""One path on three meshes: its states matched, moved to the extrapolated curve, and what is left.

May import what analysis may.
Begin with curve.py; `der/analysis/error_bars.py` puts the parts together.
"""
