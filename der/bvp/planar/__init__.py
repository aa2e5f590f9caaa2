"""The folded ring in its plane, by the reduced planar rod: shapes and packing ratios.

May import what der.bvp may, and nothing of its collocation.
Begin with folded_half.py.
"""
