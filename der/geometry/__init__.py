"""Closed planar curves, rings with their grips, cross-sections, and meshes.

May import utils only; no kernels.
Begin with ring.py.
"""
