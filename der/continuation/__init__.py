"""Following the equilibria of any system with a parameter, and the events on the way.

May import the seam (problem.py), errors and utils; knows nothing of rods or rings.
Begin with arclength.py, then step.py and events.py.
"""
