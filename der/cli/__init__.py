"""The command line: options, commands, and where their records go. The top layer.

May import everything; nothing imports it, and nothing else imports typer.
Begin with commands.py.
"""
