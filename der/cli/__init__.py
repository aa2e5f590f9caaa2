"""The command line: options, commands, and where their records go. The top layer.

May import everything; nothing imports it, and it alone imports typer.
Begin with commands.py, then paths.py and run.py.
"""
