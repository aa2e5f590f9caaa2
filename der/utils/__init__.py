"""Checks of arguments, files written completely or not at all, interrupts, the run loop of analyses.

May import errors only; all others may import it.
Begin with checks.py and run.py.
"""
