"""All assembly modes of any tree of turns, slides and balls, by loops in complex parameters."""
