"""The paper's figures, each a picture NAME.png and a table NAME.csv of the numbers in it.

    drawn = draw(["fig2b", "fig11"], "figures")   # files by name, and errors by name

May import everything below der.cli. Begin with figures.py, the table of all figures.
"""

from der.paper.drawing import Drawn, Interrupted
from der.paper.figures import DIAGRAMS, FIGURES, draw

__all__ = ["DIAGRAMS", "FIGURES", "Drawn", "Interrupted", "draw"]
