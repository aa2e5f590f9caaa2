"""Other equilibria of a ring, and which of them snaps to which.

May import what analysis may.
Begin with states.py.
"""
