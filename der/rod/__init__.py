"""The discrete elastic rod: state, supports and loads, gripped and free rings, stability, motion.

May import kernels, geometry, scene, continuation and the seam (problem.py).
Begin with rod.py, then system.py and gripped_ring.py.
"""
