"""Boundaries between folding modes as curves through a phase diagram.

May import bvp, scene and the cases of der.diagram; nothing of workers or files.
Begin with boundaries.py.
"""
