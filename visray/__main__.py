"""Entry point of `python -m visray`: runs the command line."""

from visray.cli import main

raise SystemExit(main())
