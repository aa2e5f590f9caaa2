"""Rings that stay in their plane: their states, and squeezing between two points.

May import what analysis may.
Begin with planar_states.py.
"""
