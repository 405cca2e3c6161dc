"""One file a question: basins, lifetimes, orbit diagrams, crises."""
