"""Controllers against each other: the same starts for all, what flies, how well and at what effort."""
