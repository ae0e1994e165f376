"""The catenary command as `python -m catenary`."""

from catenary.cli.main import main

main()
