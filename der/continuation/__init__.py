"""Continuation of the equilibria of any system with a parameter, and events on its path.

May import the seam (problem.py), errors and utils; knows nothing of rods or rings.
Begin with arclength.py, then step.py and events.py.
"""
