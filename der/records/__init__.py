"""The answers: frozen dataclasses, one codec for all of them, and tables for the terminal.

May import geometry, scene and utils; no kernels.
Begin with path.py.
"""
