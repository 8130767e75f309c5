"""What accuracy costs in time: the sections of `carillon-study accuracy`."""
