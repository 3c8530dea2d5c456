"""Studies of visray: correctness against Mitsuba, stability against exact arithmetic, cost, and this machine."""
