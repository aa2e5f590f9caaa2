"""Run time against error, of both solvers and of other codes.

May import der; run from a clone: python -m validation benchmark.
Begin with run.py.
"""
