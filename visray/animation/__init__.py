"""What moves in a scene: tracks, which give values of the scene as functions of time."""
