"""When visray was loaded, which it is first of all: where the time that a user gives begins on the command line."""

from time import perf_counter

LOADED = perf_counter()
