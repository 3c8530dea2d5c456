"""Scene files of the original VisRayTrace (2021-22), read as visray scenes."""
