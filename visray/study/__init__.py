"""Studies: how right, how stable, how fast."""
