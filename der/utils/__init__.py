"""Checks of arguments, whole-file writing, interrupts: used by all.

May import nothing of der.
Begin with checks.py.
"""
