"""The boundary-value problem of the Kirchhoff rod: the second, independent solver.

May import geometry, scene, records, continuation's events and roots; nothing of rod or kernels.
Begin with solve.py, then equations.py.
"""
