"""The command line: options, commands, and where their answers go. The top layer.

May import everything; nothing imports it, and nothing else imports typer.
Begin with commands.py.
"""
