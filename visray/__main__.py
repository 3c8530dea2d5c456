"""`python -m visray`: the command line."""

from visray.cli import main

raise SystemExit(main())
