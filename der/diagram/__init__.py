"""Phase diagrams: how a family of rings folds, and the boundaries between the answers.

May import bvp, geometry and records; of analysis nothing.
Begin with diagram.py.
"""
