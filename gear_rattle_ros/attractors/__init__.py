"""The one answer to which attractors there are, at one value or along many."""
