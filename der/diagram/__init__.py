"""Phase diagrams: how a family of rings folds, and the boundaries between the answers.

May import bvp, viz, records, scene and geometry; nothing of analysis or rod.
Begin with diagram.py, then scan.py and curves/boundaries.py.
"""
