"""Checks of arguments, complete writing of files, interrupts, and the run loop of analyses.

May import errors only; all others may import it.
Begin with checks.py and run.py.
"""
