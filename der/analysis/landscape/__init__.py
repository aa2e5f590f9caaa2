"""Energy landscapes: wells, saddles and barriers, with the grips and without.

May import what analysis may.
Begin with landscape.py.
"""
