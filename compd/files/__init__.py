"""Files on the disk: written whole, none written over by mistake, and whether one can be trusted."""
