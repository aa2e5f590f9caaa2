"""Thousands of extreme cases; every failure is explained or counted.

May import der; run from a clone: python -m validation stress.
Begin with run.py.
"""
