"""``python -m finback.cli``: the program where it is not on the path."""

from finback.cli.main import main

main()
