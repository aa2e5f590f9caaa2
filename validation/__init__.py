"""The ring as a boundary-value problem, and the rod held against it and other references."""
