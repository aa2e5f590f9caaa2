"""Records as recordings for the rerun viewer (imported when sending).

May import what viz may.
Begin with recording.py.
"""
