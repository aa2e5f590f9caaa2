"""Kernels in machine code: compiled once, kept in packs, loaded without the compiler.

May import nothing of der. Begin with kernel.py.
"""
