"""Compiled arithmetic (numba): strains, assembly, factorisation, writhe. Arrays in, arrays out.

May import nothing of der.
Begin with strain.py, then assembly.py and block_ldl.py.
"""
