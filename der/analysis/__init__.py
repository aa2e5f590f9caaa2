"""What is asked of a ring: fold it, load it, compare two solvers, find its other states.

May import rod, bvp, continuation, records, and what lies below them.
Begin with fold.py and request.py.
"""
