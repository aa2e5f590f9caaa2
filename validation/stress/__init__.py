"""Thousands of cases far outside what anyone folds, each failure explained or counted.

May import der; run from a clone: python -m validation stress.
Begin with run.py.
"""
