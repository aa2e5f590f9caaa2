"""Records as still pictures (matplotlib, imported when drawing).

May import what viz may.
Begin with style.py and path.py.
"""
