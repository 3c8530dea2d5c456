"""Studies of visray: correctness (against Mitsuba), stability (against exact arithmetic), and cost of effects and of
accuracy; and a report about the machine that visray runs on.
"""
