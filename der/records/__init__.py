"""The answers: frozen dataclasses, one codec for all of them, and text for the terminal.

May import geometry, scene, errors and utils; no kernels. Pictures are named by text only.
Begin with record.py (what every record can do), entries.py (how entries are declared), path.py.
"""
