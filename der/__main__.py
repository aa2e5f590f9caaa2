"""`python -m der` is the command `der`."""

from der.cli.commands import main

if __name__ == "__main__":
    main()
