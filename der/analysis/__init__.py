"""What is asked of a ring: fold it, load it, compare two solvers, find its other states.

May import rod, bvp, continuation and records.
Begin with fold.py.
"""
