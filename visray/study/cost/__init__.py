"""What accuracy costs in time: every knob of a scene measured, their frontier, and the choice of knobs for a target."""
